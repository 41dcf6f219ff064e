"""Tables 5.1 and 5.2 of the report, and the numbers of one recording, as HTML."""

from __future__ import annotations

from html import escape

from boom_estimation.free_run import Prediction
from boom_identification.validation import BagValidation, Validation
from boom_input.channels import PREDICTED, Sensor
from boom_report.channels import STATISTICS, limits_text, number, ratio, statistic
from boom_report.validation.reference import REMARK, beside
from boom_report.validation.verdict import verdict


def summary(validation: Validation) -> str:
    """Tables 5.1 and 5.2."""
    rows_full, rows_reduced = [], []
    for index, bag in enumerate(validation.bags):
        pose = _pose(bag, index)
        errors = "".join(_error_cell(bag, sensor) for sensor in PREDICTED)
        kind = verdict(bag).kind
        judged = f"<td><span class='pill {kind.replace(' ', '-')}'>{kind}</span></td>"
        rows_full.append(
            f"<tr>{pose}<td class=n>{_rad(bag.full.metrics['angle_mae_rad'])}</td>{errors}"
            f"<td class=quiet>{_beside(bag, '5.1')}</td>{judged}</tr>"
        )
        difference = bag.reduced_vs_full_angle_mae_rad
        shown = "–" if difference is None else number(difference * 1e3)
        stop = " <span class='pill stopped'>stopped</span>" if bag.reduced.stopped else ""
        rows_reduced.append(
            f"<tr>{pose}<td class=n>{_rad(difference)}</td><td class=n>{shown}{stop}</td>"
            f"<td class=quiet>{_beside(bag, '5.2')}</td></tr>"
        )
    head = (
        "<th>recording</th><th class=n>q<sub>3</sub><br>[rad]</th><th class=n>q<sub>4</sub><br>[m]</th>"
        "<th class=n>load<br>[kg]</th>"
    )
    heads = "".join(f"<th class=n>{s.label}<br>{statistic(s)} [{s.error.name}]</th>" for s in PREDICTED)
    limits = limits_text(validation.bags[0].limits) if validation.bags else ""
    return (
        "<h2>Table 5.1: full model against the measurement</h2><div class=scroll><table>"
        f"<thead><tr>{head}<th class=n>MAE<br>[rad]</th>{heads}<th>thesis MAE [rad]<br>(trajectory)</th>"
        "<th>verdict</th></tr></thead>"
        f"<tbody>{''.join(rows_full)}</tbody></table></div><p class=note>MAE is (5.48), the mean absolute error "
        "of the angle; the other "
        f"columns are its value in mrad and root mean square errors. {escape(limits)}</p>"
        "<h2>Table 5.2: reduced model against the full model</h2><div class=scroll><table>"
        f"<thead><tr>{head}<th class=n>MAE<br>[rad]</th><th class=n>angle<br>mean [mrad]</th><th>thesis MAE [rad]"
        "<br>(trajectory)</th></tr></thead>"
        f"<tbody>{''.join(rows_reduced)}</tbody></table></div><p class=note>{escape(REMARK)}</p>"
    )


def errors(bag: BagValidation) -> str:
    """The numbers of one recording: both models against the measurement, channel by channel."""
    rows = []
    for sensor in PREDICTED:
        times = ratio(sensor, bag)
        off = times is None or times > 1
        limit, scale = bag.limits[sensor.judging], sensor.error.scale
        rows.append(
            f"<tr><td>{sensor.label}, {statistic(sensor)} [{sensor.error.name}]</td><td "
            f"class=n>{_scaled(bag.full, sensor.judging, scale)}</td>"
            f"<td class=n>{_scaled(bag.reduced, sensor.judging, scale)}</td>"
            f"<td class=n>{'–' if limit is None else number(limit * scale)}</td>"
            f"<td class='n{' off' if off else ''}'>{'–' if times is None else number(times, 2)}</td></tr>"
        )
        for other in sensor.statistics[1:]:
            rows.append(
                f"<tr><td>{sensor.label}, {STATISTICS[other]} [{sensor.error.name}]</td>"
                f"<td class=n>{_scaled(bag.full, sensor.metric(other), scale)}</td>"
                f"<td class=n>{_scaled(bag.reduced, sensor.metric(other), scale)}</td><td class=n>–</td><td "
                "class=n>–</td></tr>"
            )
    return (
        "<div class=scroll><table class=compact><thead><tr><th>error</th><th class=n>full</th><th class=n>reduced</th>"
        f"<th class=n>limit</th><th class=n>full / limit</th></tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
    )


def load_text(mass: float) -> str:
    """A load [kg] without its unit; an unknown one counts as none, and says so."""
    return "unknown" if mass != mass else f"{mass:g}"


def _pose(bag: BagValidation, index: int) -> str:
    c = bag.recording.configuration
    return (
        f"<td><a href='#bag-{index + 1}'>{escape(bag.recording.name)}</a></td><td class=n>{c.outer_boom_angle:g}</td>"
        f"<td class=n>{c.telescope_length:g}</td><td class=n>{load_text(c.load_mass)}</td>"
    )


def _error_cell(bag: BagValidation, sensor: Sensor) -> str:
    times = ratio(sensor, bag)
    off = " off" if times is None or times > 1 else ""
    return f"<td class='n{off}'>{_scaled(bag.full, sensor.judging, sensor.error.scale)}</td>"


def _scaled(prediction: Prediction, metric: str, scale: float) -> str:
    value = prediction.metrics[metric]
    return "–" if value is None else number(value * scale)


def _rad(value: float | None) -> str:
    return "–" if value is None else f"{value:.5f}"


def _beside(bag: BagValidation, table: str) -> str:
    return beside(bag.recording.configuration, table) or "none alike"
