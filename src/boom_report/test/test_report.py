"""The report: one file, nothing from the network, everything in it, whatever the recording lacks."""

import base64
import dataclasses
import io
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from diagnosis_samples import constant, simulated, tz17, validated
from markupsafe import Markup

from boom_identification.validation import Validation, validate
from boom_recording.recording import Configuration, Event
from boom_report import events, palette, templates, terms
from boom_report.channels import number
from boom_report.console import WIDTH, console_for
from boom_report.decimation import decimate
from boom_report.packing import inflated
from boom_report.page import page as whole_page
from boom_report.validation.figure import figure
from boom_report.validation.reference import beside
from boom_report.validation.report import write_report
from boom_report.validation.tables import summary
from boom_report.validation.terminal import print_validation
from boom_report.validation.verdict import verdict


class Page(HTMLParser):
    """What a browser would see: text, links, tables by heading, JSON of the charts."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.text, self.addresses, self.charts, self.libraries, self.ids, self.rows = [], [], [], [], [], []
        self._inside, self._cell = "", False
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.addresses += [values[name] for name in ("src", "href", "data", "action", "poster") if values.get(name)]
        self.ids += [values["id"]] if "id" in values else []
        if tag in ("script", "style"):
            self._inside = values.get("type") or tag
            self._library = values.get("class") == "library"
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th") and self.rows:
            self.rows[-1].append("")
            self._cell = True

    def handle_endtag(self, tag):
        self._inside = ""
        self._cell = self._cell and tag not in ("td", "th")

    def handle_data(self, data):
        if self._inside == "text/plain":
            text = inflated(data)
            (self.libraries if self._library else self.charts).append(text if self._library else json.loads(text))
        elif not self._inside:
            self.text.append(data)
            if self._cell:
                self.rows[-1][-1] += data


def page_of(tmp_path, *bags, **options):
    path = tmp_path / "report.html"
    write_report(Validation("tz17", list(bags)), path, **options)
    html = path.read_text(encoding="utf-8")
    return html, Page(html)


def stopped():
    recording = constant(15.0, angle=0.4, hose_pressure=6e6, rod_pressure=1e6)
    signal = recording.signals["extend_current"]
    lifting = np.where(signal.time > 2.0, 0.55, 0.0)
    recording.signals["extend_current"] = dataclasses.replace(signal, values=lifting)
    return validate(recording, tz17())


def without(name):
    recording = constant(angle=0.4, hose_pressure=6e6)
    signal = recording.signals[name]
    recording.signals[name] = dataclasses.replace(signal, valid=np.zeros(len(signal.time), bool))
    return validate(recording, tz17())


def test_the_report_loads_nothing_from_anywhere(tmp_path):
    html, page = page_of(tmp_path, validated("healthy/folded_fast"))
    assert all(address.startswith("#") for address in page.addresses)
    assert "default-src 'none'" in html
    style = re.search(r"<style>(.*?)</style>", html, re.S)[1]
    assert "url(" not in style and "@import" not in style
    assert "Permission is hereby granted" in html
    assert [library.count("plotly.js (cartesian - minified) v") for library in page.libraries] == [1]


def test_the_charts_cannot_be_sent_to_the_charting_librarys_server(tmp_path):
    html, page = page_of(tmp_path, validated("healthy/folded_fast"))
    assert "showSendToCloud: false" in html
    assert "cloud.plotly.com" not in page.libraries[0] and "chart-studio" not in page.libraries[0]


def test_the_report_holds_tables_command_checksums_and_provenance(tmp_path):
    bag = validated("explained/payload_change_a")
    _, page = page_of(tmp_path, bag, command="./boom validate x", machine=tz17(), machine_source="tz17")
    text = "".join(page.text)
    assert "Table 5.1" in text and "Table 5.2" in text and "./boom validate x" in text
    assert "is inferred" in text
    assert any(row[0] == "hose_burst_valve.a11" for row in page.rows)
    checksums = [row[-1] for row in page.rows if re.fullmatch("[0-9a-f]{64}", row[-1])]
    assert len(checksums) == 2
    first = next(row for row in page.rows if row[0] == "payload_change_a")
    assert first[4] == f"{bag.full.metrics['angle_mae_rad']:.5f}"
    assert first[7] == number(bag.full.metrics["hose_pressure_rmse_pa"] * 1e-5)
    assert first[-2:] == ["0.035 (3)", "differs"]


def test_every_recording_has_a_chart_of_four_channels_with_residuals_and_currents(tmp_path):
    _, page = page_of(tmp_path, validated("healthy/folded_fast"), validated("damaged/gap_in_motion"))
    picture, *charts = page.charts
    assert len(picture["data"][0]["y"]) == 8 and len(charts) == 2
    for chart in charts:
        axes = {trace["yaxis"] for trace in chart["data"] if "yaxis" in trace}
        assert len(axes) == 9
        linked = [key for key in chart["layout"] if key.startswith("xaxis") and key != "xaxis"]
        assert all(chart["layout"][key]["matches"] == "x" for key in linked) and len(linked) == 8
        drawn = {trace["name"] for trace in chart["data"]}
        assert {"measured", "full model", "reduced model", "retract (lower)", "extend (lift)"} <= drawn


def test_gaps_are_shaded_in_the_chart_and_listed_in_the_table(tmp_path):
    _, page = page_of(tmp_path, validated("damaged/gap_in_motion"))
    shaded = [s for s in page.charts[1]["layout"]["shapes"] if "domain" not in s["xref"]]
    assert len(shaded) == 9
    assert all(s["x0"] == pytest.approx(24.19, abs=0.01) and s["x1"] == pytest.approx(25.40, abs=0.01) for s in shaded)
    listed = [row for row in page.rows if row[0] in ("gap", "loss")]
    assert len(listed) == 8
    assert "in motion, fitted to 25.40 s to 26.40 s" in "".join(page.text)


def test_two_recordings_of_one_name_stay_apart(tmp_path):
    bag = validated("healthy/folded_fast")
    _, page = page_of(tmp_path, bag, bag)
    assert len(page.ids) == len(set(page.ids))
    assert {"#bag-1", "#bag-2"} <= set(page.addresses)


def test_a_page_with_an_id_twice_cannot_be_built():
    assert "</html>" in whole_page("x", "<p id=a>id='a'</p><p class=x id='b'>")
    with pytest.raises(AssertionError, match="'a'"):
        whole_page("x", "<section class='card' id='a'><p id=a></p></section>")


def test_a_run_that_stopped_is_told_in_red(tmp_path):
    html, page = page_of(tmp_path, stopped())
    assert re.search(r"<p class=alert>The full model stopped: at [\d.]+ s angle \(q_2\) left its range", html)
    assert any("stopped" in row[-1] for row in page.rows if row and row[0] == "constant")


def test_a_sensor_that_was_not_recorded_leaves_a_dash_and_is_told(tmp_path):
    bag = without("rod_pressure")
    _, page = page_of(tmp_path, bag)
    row = next(row for row in page.rows if row[0] == "constant")
    assert [cell == "–" for cell in row[4:9]] == [False] * 4 + [True]
    assert verdict(bag).kind == "not compared" and "2 s are too few" in verdict(bag).short
    assert "Not compared, for lack of valid samples: rod pressure" in "".join(page.text)


@pytest.mark.parametrize("name", ["angle", "retract_current"])
def test_a_channel_without_a_valid_sample_leaves_dashes(tmp_path, name):
    _, page = page_of(tmp_path, without(name))
    row = next(row for row in page.rows if row[0] == "constant")
    assert row[4:9] == ["–"] * 5
    assert "not compared" in "".join(page.text)


def test_control_characters_of_a_recording_are_written_out():
    shown = templates._environment("boom_report").from_string("{{ note }}{{ fragment }}")
    assert shown.render(note="<a>\x1b[2J", fragment=Markup("<b>\n</b>")) == "&lt;a&gt;\\x1b[2J<b>\n</b>"


def test_names_that_look_like_html_do_no_harm(tmp_path):
    bag = validated("damaged/gap_in_motion")
    bad = "</script><b onclick='x'>"
    recording = dataclasses.replace(bag.recording, name=bad, warnings=[bad])
    recording.events.append(Event("nan", "/joint_states", 1.0, 1.0, 1, bad))
    html, page = page_of(tmp_path, dataclasses.replace(bag, recording=recording), title=bad, command=bad)
    assert bad not in html
    assert bad in "".join(page.text)
    recording.events.pop()


def test_warnings_of_a_damaged_file_and_notes_are_shown(tmp_path):
    bag = validated("healthy/folded_fast")
    recording = dataclasses.replace(bag.recording, warnings=["cut at 31.2 s"])
    _, page = page_of(tmp_path, dataclasses.replace(bag, recording=recording), notes=("recorded elsewhere",))
    assert "damaged file: cut at 31.2 s" in page.text
    assert "recorded elsewhere" in page.text


def test_an_unwritable_path_is_an_os_error(tmp_path):
    with pytest.raises(OSError):
        write_report(Validation("tz17", []), tmp_path / "no" / "such.html")


def test_the_chart_holds_no_more_points_than_a_screen_can_show():
    time = np.arange(100_000) * 0.01
    values = np.zeros(100_000)
    values[54_321], values[12_345] = 7.0, -5.0
    x, y = decimate(time, values)
    assert len(x) <= 4000
    assert y.max() == 7.0 and y.min() == -5.0
    assert x[np.argmax(y)] == time[54_321]
    assert (np.diff(x) > 0).all()


def test_a_line_is_broken_where_samples_are_missing_or_masked():
    time = np.array([0.0, 0.01, 0.02, 0.20, 0.21, 0.22])
    x, y = decimate(time, np.array([1.0, 2.0, 3.0, 4.0, np.nan, 6.0]))
    assert np.isnan(y).tolist() == [False, False, False, True, False, True, False]
    assert len(x) == len(y)
    assert decimate(time, np.full(6, np.nan))[0].size == 0


def test_slow_samples_are_joined_and_a_loss_among_them_is_not():
    """Of a channel of 20 Hz every line had been dotted."""
    time = np.arange(100) * 0.05 + 0.004 * np.sin(np.arange(100))
    time[60:] += 0.3
    assert np.isnan(decimate(time, np.sin(time))[1]).sum() == 1


def test_breaks_survive_the_reduction_of_points():
    time = np.concatenate((np.arange(50_000), np.arange(50_000) + 70_000)) * 0.01
    _, y = decimate(time, np.sin(time))
    assert np.isnan(y).sum() == 1


def test_charts_hold_the_samples_themselves():
    bag = validated("healthy/folded_fast")
    trace = figure(bag)["data"][0]
    x = np.frombuffer(base64.b64decode(trace["x"]["bdata"]), "<f4")
    y = np.frombuffer(base64.b64decode(trace["y"]["bdata"]), "<f4")
    signal = bag.recording.signals["angle"]
    assert np.isin(x, signal.time.astype("f4")).all()
    assert y.max() == signal.values.max().astype("f4")


def test_the_verdict_names_what_differs_most_in_multiples_of_its_limit():
    bag = validated("explained/payload_change_a")
    said = verdict(bag)
    times = bag.full.metrics["hose_pressure_rmse_pa"] / bag.limits["hose_pressure_rmse_pa"]
    assert said.short.startswith(f"differs: hose pressure 14.9 bar rms, {times:.0f} x its noise limit")
    assert "the first at 27 s" in said.sentence


@pytest.mark.parametrize(
    ("make", "kind"),
    [
        (lambda: validated("healthy/extended"), "agrees"),
        (lambda: validated("explained/hose_burst_valve_lag_b"), "differs"),
        (stopped, "stopped"),
        (lambda: without("angle"), "not compared"),
    ],
)
def test_the_verdict_is_of_four_kinds(make, kind):
    assert verdict(make()).kind == kind


def test_thesis_values_stand_beside_recordings_of_the_same_pose_and_load():
    assert beside(Configuration("tz17", 0.28, 2.8, 300.0), "5.1") == "0.037 (4)"
    assert beside(Configuration("tz17", 4.59, 0.0, 0.0), "5.2") == "0.009 (1), 0.018 (2)"
    assert beside(Configuration("tz17", 0.28, 2.2, 100.0), "5.1") == ""
    assert beside(Configuration("tz17", 1.0, 1.0, float("nan")), "5.1") == ""


def test_a_crane_in_poses_that_the_thesis_did_not_have_is_not_told_of_it(capsys):
    known = validated("healthy/extended")
    posed = dataclasses.replace(known.recording, stored_configuration=Configuration("mine", 0.0, 0.0, 0.0))
    for bag, told in ((known, True), (dataclasses.replace(known, recording=posed), False)):
        print_validation(Validation("tz17", [bag]), console_for())
        assert ("thesis" in capsys.readouterr().out) is told
        assert ("thesis MAE" in summary(Validation("tz17", [bag]))) is told
    assert "thesis MAE" not in summary(Validation("mine", [known]))


def test_the_errors_of_a_run_that_stopped_say_of_how_much_they_are(capsys):
    bag = stopped()
    print_validation(Validation("tz17", [bag]), console_for())
    assert re.search(r"stopped: \d\.\d of 15\.0 s", capsys.readouterr().out.replace("\n", " "))


def test_events_at_the_same_time_are_one_line_and_losses_another():
    lines = events.summary(validated("damaged/gap_and_losses").recording.events)
    assert lines == [
        "gap 21.29 s to 24.10 s, on 4 topics: no sample for 2.81 s",
        "loss of 459 single samples, on 4 topics",
    ]


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.000249, "0.000249"), (1.5, "1.50"), (13.58, "13.6"), (1234.5, "1234"), (-0.02, "-0.0200")],
)
def test_numbers_have_three_significant_digits(value, text):
    assert number(value) == text


def test_terminal_tables_fit_100_columns_and_are_plain_when_piped(capsys):
    bags = [validated(f"explained/{name}") for name in ("hose_burst_valve_lag_a", "payload_change_b")]
    print_validation(Validation("tz17", [*bags, without("rod_pressure"), stopped()]), console_for())
    printed = capsys.readouterr().out
    assert "Table 5.1" in printed and "Table 5.2" in printed and "hose_burst_valve_lag_a" in printed
    assert "\x1b" not in printed
    assert max(len(line) for line in printed.splitlines()) <= WIDTH


@pytest.mark.parametrize("width", [56, 70])
def test_tables_keep_names_and_numbers_whole_on_a_narrow_terminal(width):
    stream = io.StringIO()
    print_validation(Validation("tz17", [validated("explained/payload_change_b")]), console_for(stream, width))
    printed = stream.getvalue()
    assert "…" not in printed and "rod rms" in printed and "0.00" in printed
    assert max(len(line.rstrip()) for line in printed.splitlines()) <= width


@pytest.mark.parametrize(
    ("duration", "current", "said"),
    [(1.0, 0.5, "1 s are too few, at least 5 s are needed"), (8.0, 0.0, "the boom did not move")],
)
def test_too_short_or_standing_recordings_are_not_said_to_agree(duration, current, said):
    time = np.arange(round(duration / 0.01)) * 0.01
    currents = np.column_stack((np.zeros_like(time), np.where(time > 0.95, current, 0.0)))
    bag = validate(simulated(duration, currents), tz17())
    assert said in verdict(bag).short
    assert bag.document()["agrees"] is False


def test_a_colour_stands_for_one_thing_and_has_its_counterpart_on_a_dark_screen():
    assert len(palette.DARK) == palette.style().count("--") / 2
    literal = re.compile(r"['\" ]#[0-9a-fA-F]{6}\b|rgba\(")
    folders = (Path(__file__).parents[2] / name / name for name in ("boom_report", "boom_trials"))
    sources = [path for folder in folders for path in folder.rglob("*") if path.suffix in (".py", ".html", ".css")]
    kept = {path.name for path in sources if path.parent.name != "vendor" and literal.search(path.read_text())}
    assert kept == {"palette.py", "view.css", "dark.css"}  # the moving crane has colours of its own, for light and dark


def test_every_word_that_a_report_explains_has_a_sentence():
    page = terms.section("free run", "NRMSE")
    assert page.count("<dt>") == 2
    with pytest.raises(KeyError):
        terms.section("a word of no report")
