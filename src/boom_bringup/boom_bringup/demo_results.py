"""The results of a demo, validation of the open loop and tracking of the closed loop, as tables, report and document."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boom_identification.validation import BagValidation, Validation
from boom_report.tracking import report
from boom_report.validation import terminal
from boom_report.validation.report import write_report

if TYPE_CHECKING:
    from boom_model.machine import Machine
    from boom_recording.recording import Recording
    from boom_report.tracking.position_error import Tracking


@dataclass(frozen=True)
class Tracked:
    """The closed loop: the recording, the tracking errors and the control law."""

    recording: Recording
    tracking: Tracking
    mode: str


@dataclass(frozen=True)
class Results:
    """All results of one demo.

    machine, source   the simulated machine, and the user's name for it
    recording         the recording that was repeated or followed
    open_loop, closed_loop   None where not requested
    """

    machine: Machine
    source: str | None
    recording: Recording
    open_loop: BagValidation | None
    closed_loop: Tracked | None

    def show(self, console: Any) -> None:
        """Tables on the terminal."""
        if self.open_loop is not None:
            terminal.print_validation(self._validation(), console)
        if self.closed_loop is not None:
            report.print_tracking(self.closed_loop.tracking, self.closed_loop.mode, console)

    def report(self, path: Path, command: str) -> None:
        """One HTML file. Raises OSError where it cannot be written."""
        write_report(
            self._validation(), path, title=f"Demo: {self.recording.name}", machine=self.machine,
            machine_source=self.source, command=command, sections=self._sections(),
        )  # fmt: skip

    def document(self) -> dict[str, Any]:
        """As ``validate --json``, and ``closed_loop`` with the numbers of (6.29)."""
        document = self._validation().document()
        if self.closed_loop is not None:
            document["closed_loop"] = {"mode": self.closed_loop.mode, **self.closed_loop.tracking.errors.document()}
        return document

    def _validation(self) -> Validation:
        return Validation(self.machine.name, [self.open_loop] if self.open_loop is not None else [])

    def _sections(self) -> tuple[str, ...]:
        if self.closed_loop is None:
            return ()
        c = self.closed_loop
        return (report.section(c.tracking, c.recording, c.mode),)
