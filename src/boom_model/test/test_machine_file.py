"""Machine files: what is shipped loads, what is spoilt is refused in one line that names the key and the range."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import pytest
import yaml

from boom_model.errors import MachineError
from boom_model.machine import Machine
from boom_model.machine_file import check_machine, load_machine, machine_from, shipped_machine

Spoil = Callable[[dict[str, Any]], object]


def put(path: str, value: Any) -> Spoil:
    *way, last = path.split(".")

    def change(document: dict[str, Any]) -> None:
        for key in way:
            document = document[key]
        document[last] = value

    return change


def drop(path: str) -> Spoil:
    *way, last = path.split(".")

    def change(document: dict[str, Any]) -> None:
        for key in way:
            document = document[key]
        del document[last]

    return change


TZ17 = (resources.files("boom_model") / "machines" / "tz17.yaml").read_text(encoding="utf-8")
CASES: dict[str, tuple[Spoil, str]] = {
    "missing_section": (drop("friction"), "friction: the section is missing"),
    "missing_optional_component": (drop("accumulators"), r"accumulators: the section is missing; .*type: none"),
    "missing_key": (drop("fluid.rho"), r"fluid\.rho: missing \(density of the oil\); expected 600 \.\. 1200 kg/m\^3"),
    "misspelt_section": (
        lambda d: d.update(frction=d.pop("friction")),
        "frction: no such section; did you mean friction",
    ),
    "misspelt_key": (
        lambda d: d["fluid"].update(beat=d["fluid"].pop("beta")),
        r"fluid\.beat: no such key; did you mean beta",
    ),
    "misspelt_inner_key": (
        put("fluid.beta", {"value": 1e9, "unit": "Pa", "porv": "x"}),
        r"fluid\.beta\.porv: no such key",
    ),
    "decimal_comma": (
        lambda d: d["fluid"].update(rho=yaml.safe_load("{value: 870,5, unit: kg/m^3}")),
        r"fluid\.rho\.5: no such key; if 870,5 is meant: decimals stand behind a point, 870\.5",
    ),
    "too_large": (put("fluid.rho.value", 8700.0), r"fluid\.rho: 8700.0 is outside 600 \.\. 1200 kg/m\^3"),
    "negative": (put("cylinder.A_a.value", -1e-2), r"cylinder\.A_a: -0\.01 is outside 1e-05 \.\. 1 m\^2"),
    "nan": (
        put("cylinder.l_p.value", float("nan")),
        r"cylinder\.l_p: nan is outside 0\.01 \.\. 10 m",
    ),
    "infinite": (put("friction.tau_C_pos.value", float("inf")), r"friction\.tau_C_pos: inf is outside"),
    "text_for_number": (
        put("fluid.rho.value", "heavy"),
        r"fluid\.rho: 'heavy' is a text: write a number of 600 \.\. 1200",
    ),
    "quoted_number": (put("fluid.rho.value", "870"), r"fluid\.rho: '870' is a text: .* without quotes"),
    "empty_section_that_may_lack": (
        put("control", None),
        "control: expected keys with values below it, or leave the section out$",
    ),
    "empty_section": (put("fluid", None), "fluid: expected keys with values below it$"),
    "none_for_number": (
        put("fluid.rho.value", None),
        r"fluid\.rho: there is no number: write one of 600 \.\. 1200 kg/m\^3",
    ),
    "truth_for_number": (put("fluid.rho.value", True), r"fluid\.rho: true is no number: write one of 600 \.\. 1200"),
    "list_for_number": (put("fluid.rho.value", [870.0]), r"fluid\.rho: \[870\.0\] is outside 600 \.\. 1200"),
    "number_for_list": (put("kinematics.att.value", 0.4), r"kinematics\.att: expected a list of 2 numbers \[m\]"),
    "short_list": (put("pilot_valves.h.value", [76.1, -0.58]), r"pilot_valves\.h: expected a list of 3 numbers"),
    "bare_number": (put("fluid.rho", 870.0), r"fluid\.rho: write \{value: \.\.\., unit: kg/m\^3\}"),
    "wrong_unit": (put("fluid.beta.unit", "bar"), r"fluid\.beta\.unit: bar; expected Pa"),
    "missing_unit": (drop("fluid.beta.unit"), r"fluid\.beta\.unit: missing; expected Pa"),
    "unknown_confidence": (put("fluid.beta.conf", "sure"), r"fluid\.beta\.conf: 'sure' is not high, medium or low"),
    "unknown_type": (
        put("kinematics.type", "five_bar"),
        r"kinematics\.type: 'five_bar' is not one of four_bar, triangle",
    ),
    "pilot_without_spool": (put("pilot_valves", {"type": "none"}), r"pilot_valves\.type: none goes with .*direct"),
    "other_linkage_lacks_keys": (put("kinematics.type", "triangle"), r"kinematics\.(foot|a)"),
    "compensator_not_boolean": (
        put("main_valve_orifices.compensator", "yes"),
        r"compensator: 'yes' is not true or false",
    ),
    "anti_cavitation_unsaid": (
        drop("main_valve_orifices.anti_cavitation.enabled"),
        r"anti_cavitation\.enabled: say true or false",
    ),
    "anti_cavitation_area": (drop("main_valve_orifices.anti_cavitation.A_ac"), r"anti_cavitation\.A_ac: missing"),
    "meter_out_form": (put("main_valve_orifices.A_ta_law.value", "2*A_sb"), r"A_ta_law: '2\*A_sb' is not of the form"),
    "meter_out_pole": (put("main_valve_orifices.A_ta_law.value", "A_sb/(1.0-0.7*u^2)"), "not positive up to u = 1.3"),
    "stroke_too_short": (
        put("cylinder.l_p.value", 0.5),
        r"kinematics: .* needs s_p = .* but the stroke cylinder\.l_p is",
    ),
    "linkage_apart": (put("kinematics.L2.value", 0.02), r"kinematics: the linkage cannot be assembled"),
    "limits_swapped": (put("kinematics.q2_max.value", -1.2), r"kinematics\.q2_max: -1\.2 rad is not above"),
    "missing_limit": (drop("kinematics.q2_max"), r"kinematics\.q2_max: missing"),
    "areas_swapped": (put("cylinder.A_b.value", 2e-2), r"cylinder\.A_b: 0\.02 m\^2 is not smaller than A_a"),
    "burst_valve_not_smooth": (put("hose_burst_valve.node.value", -15.0), r"hose_burst_valve\.node: -15 does not fit"),
    "no_poses": (put("rigid_body.configs", {}), r"rigid_body\.configs: missing"),
    "pose_lacks_key": (drop("rigid_body.configs.T3_extended.Sx"), r"rigid_body\.configs\.T3_extended\.Sx: missing"),
    "pose_not_finite": (
        put("rigid_body.configs.T3_extended.Sx", float("nan")),
        r"T3_extended\.Sx: nan is not a number up to 1e\+09",
    ),
    "pilot_curve_flat": (
        put("pilot_valves.h.value", [0, 40.0, 0.2]),
        r"pilot_valves\.h: the first number must be at least",
    ),
    "pose_huge": (put("rigid_body.configs.T3_extended.Sx", 1e300), r"T3_extended\.Sx: 1e\+300 is not a number up to"),
    "tolerance_wider_than_all": (
        put("fluid.beta.tol", 1e300),
        r"fluid\.beta\.tol: .* is wider than all that it may be",
    ),
    "meter_out_tolerance": (
        put("main_valve_orifices.A_ta_law.tol", {"abs": 0.1}),
        r"A_ta_law\.tol: a share of the area",
    ),
    "absolute_tolerance_wider_than_all": (put("fluid.rho.tol", {"abs": 1e4}), r"fluid\.rho\.tol: .*600 \.\. 1200 kg/m"),
    "blanks_about_name": (put("meta.name", " tz17 "), r"meta\.name: .* without blanks around them"),
    "vent_without_area": (put("main_valve_orifices.neutral", "vented"), r"main_valve_orifices\.A_v"),
    "neutral_of_no_kind": (
        put("main_valve_orifices.neutral", "open"),
        r"main_valve_orifices\.neutral: 'open' is not one of",
    ),
    "long_name": (put("meta.name", "x" * 100_000), r"meta\.name: give one line of at most 100"),
    "name_for_a_terminal": (put("meta.name", "a\x1b[2J"), r"meta\.name: give one line"),
    "list_for_confidence": (
        put("main_valve_orifices.A_ta_law.conf", ["low"]),
        r"A_ta_law\..*conf: \['low'\] is not high",
    ),
    "text_for_derived_number": (put("hose_burst_valve.node", "near"), r"hose_burst_valve\.node: nan does not fit"),
    "list_for_bodies": (put("rigid_body.planar.bodies", ["arm"]), r"planar\.bodies: expected keys with values"),
    "number_for_axes": (put("rigid_body.planar.bodies.inner_boom.axes", 5), r"axes: 5 given, expected a list of names"),
    "number_for_joint_limits": (
        put("rigid_body.joint_limits", 5),
        r"joint_limits\.q3: missing|joint_limits: expected keys",
    ),
    "huge_mass": (put("rigid_body.links.inner_boom.m", 1e300), r"inner_boom\.m: 1e\+300 given, expected a number of 0"),
    "cylinder_without_length": (
        lambda d: (
            d["rigid_body"]["planar"]["arm_cylinder"].update(eye=[0.0, 0.0], foot=[0.0, 0.0])
            or d["rigid_body"]["planar"].update(elbow=[0.0, 0.0], arm_origin=[0.0, 0.0])
        ),
        r"arm_cylinder: foot and eye lie in one point",
    ),
    "pose_in_degrees": (
        put("rigid_body.configs.T3_extended.q3", 16.0),
        r"q3: 16 rad is more than a turn: is it in degrees\?",
    ),
    "limits_in_degrees": (
        put("rigid_body.joint_limits.q3", [-10.0, 165.0]),
        r"-10 .. 165 rad is more than a turn",
    ),
    "pose_without_inertia": (put("rigid_body.configs.T3_extended.D0", -1.0), r"D0: -1 is not a positive inertia"),
    "pose_tip": (put("rigid_body.configs.T3_extended.tip", [1.0]), r"T3_extended\.tip: expected \[x, y\] in m"),
    "absolute_pressures": (put("meta.pressure_reference", "absolute"), r"meta\.pressure_reference: only gauge"),
    "no_name": (drop("meta.name"), r"meta\.name: missing"),
    "not_a_mapping": (put("fluid", [1, 2]), r"fluid: expected keys with values"),
    "unknown_effect": (
        put("effects", {"hose_burst_lag": {"tau": 0.1}}),
        r"effects\.hose_burst_lag: no such effect; did you mean",
    ),
    "unknown_effect_parameter": (
        put("effects", {"payload": {"weight": 10}}),
        r"effects\.payload\.weight: no such parameter",
    ),
    "effect_out_of_range": (
        put("effects", {"payload": {"mass": 1e6}}),
        r"effects\.payload\.mass: 1e\+06 kg is outside -500 \.\. 5000 kg",
    ),
    "effect_not_a_number": (
        put("effects", {"payload": {"mass": "log"}}),
        r"effects\.payload\.mass: 'log' is not a finite number",
    ),
    "confidence_not_a_text": (put("fluid.beta.conf", ["low"]), r"fluid\.beta\.conf: \['low'\] is not high"),
    "meter_out_two_signs": (put("main_valve_orifices.A_ta_law.value", "A_sb/(--2.27-0.7*u^2)"), "is not of the form"),
    "meter_out_no_number": (put("main_valve_orifices.A_ta_law.value", "A_sb/(e-0.7*u^2)"), "is not of the form"),
    "sample_time_zero": (put("control.Ts.value", 0), r"control\.Ts: 0\.0 is outside 0\.0001 \.\. 1 s"),
    "noise_negative": (put("control.p_noise_psd.value", -3e6), r"control\.p_noise_psd: -3000000\.0 is outside"),
    "noise_no_number": (put("control.p_noise_psd.value", "lots"), r"control\.p_noise_psd: 'lots' is a text"),
    "resolution_unit": (put("control.q2_quant.unit", "deg"), r"control\.q2_quant\.unit: deg; expected rad"),
    "name_not_a_text": (put("meta.name", 17), r"meta\.name: 17 is not a text"),
    "joint_limits_no_mapping": (put("rigid_body.joint_limits", 5), r"rigid_body\.joint_limits\.q3: missing"),
    "joint_limits_text": (
        put("rigid_body.joint_limits.q3", ["abc", 4.6]),
        r"rigid_body\.joint_limits\.q3: .* expected",
    ),
    "joint_limits_swapped": (put("rigid_body.joint_limits.q3", [4.6, -0.9]), r"joint_limits\.q3: 4\.6 \.\. -0\.9 rad"),
    "link_mass_negative": (put("rigid_body.links.inner_boom.m", -400), r"links\.inner_boom\.m: -400 given"),
    "plateau_without_slope": (put("hose_burst_valve.a31.value", 0.0), r"hose_burst_valve\.a31: 0\.0 is outside 1e-06"),
    "dead_zone_beyond_the_stroke": (
        lambda d: (
            put("main_valve_orifices.x0.value", 0.6)(d),
            put("effects", {"valve_dead_zone": {"d_retract": 0.5}})(d),
        ),
        r"valve_dead_zone\.d_retract: 0\.5 is outside -0\.6 \.\. 0\.35",
    ),
    "learned_terms": (put("learned", {"equation": "torque"}), "learned: expected a list"),
}


@pytest.mark.parametrize("name", list(CASES))
def test_spoilt_file_is_refused_in_one_line_that_names_the_key(document: dict[str, Any], name: str) -> None:
    spoil, message = CASES[name]
    spoil(document)
    with pytest.raises(MachineError, match=message) as caught:
        machine_from(document)
    assert "\n" not in str(caught.value)


def test_key_given_twice_is_refused_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "twice.yaml"
    path.write_text("fluid:\n  rho: {value: 870.0}\n  rho: {value: 900.0}\n")
    with pytest.raises(MachineError, match=r"twice\.yaml, line 3: .*rho is given twice"):
        load_machine(path)


def test_key_that_is_a_list_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "odd.yaml"
    path.write_text("? [a, b]\n: 1\n")
    with pytest.raises(MachineError, match=r"odd\.yaml"):
        load_machine(path)


@pytest.mark.parametrize("text", ["", "- 1\n- 2\n", "a: [1, 2\n", "just words"])
def test_what_is_no_machine_file_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(MachineError, match=r"bad\.yaml"):
        load_machine(path)


def test_file_that_is_not_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(MachineError, match=r"binary\.yaml: cannot be read: not a text file"):
        load_machine(path)


def test_missing_file_and_unknown_name_are_told_apart(tmp_path: Path) -> None:
    with pytest.raises(MachineError, match=r"none\.yaml: cannot be read: No such file"):
        load_machine(tmp_path / "none.yaml")
    with pytest.raises(MachineError, match=r"tz18: no such machine; shipped are .*tz17"):
        load_machine("tz18")


def test_a_refusal_names_the_file_and_the_line(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(TZ17.replace("{value: 870.0, unit: kg/m^3", "{value: 8700.0, unit: kg/m^3"), encoding="utf-8")
    line = next(k for k, text in enumerate(TZ17.splitlines(), 1) if text.lstrip().startswith("rho:"))
    with pytest.raises(MachineError, match=rf"mine\.yaml, line {line}: fluid\.rho: 8700\.0 is outside"):
        load_machine(path)
    path.write_text("a: [1\n", encoding="utf-8")
    with pytest.raises(MachineError, match=r"mine\.yaml, line 2: not readable as YAML"):
        load_machine(path)


def test_all_faults_of_a_file_are_told_at_once(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    text = TZ17.replace("{value: 870.0, unit", "{value: 8700.0, unit").replace("  beta:", "  " + "b" * 150 + ":")
    path.write_text(text.replace("conf: high", "conf: sure", 1), encoding="utf-8")
    machine, faults = check_machine(path)
    assert machine is None
    for words in ("fluid.rho: 8700.0 is outside", "fluid.beta: missing", "no such key", "'sure' is not high"):
        assert sum(words in fault for fault in faults) == 1, words
    assert all(len(fault) < 800 and fault.isprintable() for fault in faults)


def test_number_that_yaml_1_1_takes_for_a_text_is_a_number_and_a_quoted_one_is_none(tmp_path: Path) -> None:
    path = tmp_path / "machine.yaml"
    beta = next(line for line in TZ17.splitlines() if line.lstrip().startswith("beta:"))
    for value, fault in (
        ("1.6e9", ""),
        ("1600000000000e-03", ""),
        ('"1.6e9"', "'1.6e9' is a text"),
        ("1_600.0e+6", "a number with _ in it"),
    ):
        path.write_text(TZ17.replace(beta, re.sub(r"value: [^,]+", f"value: {value}", beta)), encoding="utf-8")
        if fault:
            with pytest.raises(MachineError, match=fault):
                load_machine(path)
        else:
            assert load_machine(path).parameters["fluid.beta"].value == (1.6e9,)


# ------------------------------------------------------------------------------------------------------ what is shipped


def test_tz17_has_the_structure_of_the_thesis(tz17: Machine) -> None:
    names = {c.slot: c.name for c in tz17.structure}
    assert names == {
        "linkage": "four_bar", "friction": "joint",
        "accumulators": "two_diaphragm", "hose_burst_valve": "flow_limiting", "spool": "pilot_operated",
        "pilot_valves": "wiener", "supply": True, "metering": "common_overlap", "port_valves": True, "neutral": "shut",
    }  # fmt: skip
    assert tz17.parameters["pilot_valves.h"].value == (76.1, -0.58, 0.247)
    assert tz17.parameters["main_valve_orifices.A_ta_law.c0"].value == (2.27,)


@pytest.mark.parametrize("tol", [0.4, {"factor": 1.4}])
def test_the_tolerance_of_an_area_in_a_law_or_a_group_is_that_of_its_numbers(
    document: dict[str, Any], tol: Any
) -> None:
    document["main_valve_orifices"]["A_ta_law"]["tol"] = tol
    document["main_valve_orifices"]["anti_cavitation"]["tol"] = tol
    machine = machine_from(document)
    for key in ("A_ta_law.c0", "A_ta_law.c1", "anti_cavitation.A_ac"):
        assert machine.parameters[f"main_valve_orifices.{key}"].tolerance == pytest.approx(0.4)
    assert machine.parameters["main_valve_orifices.anti_cavitation.p_open"].tol is None


def test_file_of_the_same_machine_in_the_shared_folder_is_the_same() -> None:
    path = Path(__file__).resolve().parents[4] / "shared" / "machine" / "tz17.yaml"
    if not path.exists():
        pytest.skip("no shared/machine/tz17.yaml beside the project: the shipped file has nothing to be compared with")
    shared, ours = load_machine(path), load_machine("tz17")
    assert {k: v.value for k, v in shared.parameters.items()} == {k: v.value for k, v in ours.parameters.items()}


def test_other_make_has_another_structure(other_make: Machine) -> None:
    names = {c.slot: c.name for c in other_make.structure}
    assert names == {
        "linkage": "triangle", "friction": "joint",
        "accumulators": "none", "hose_burst_valve": "none", "spool": "direct", "pilot_valves": "none",
        "supply": False, "metering": "common_overlap", "port_valves": True, "neutral": "shut",
    }  # fmt: skip
    assert other_make.parameters["fluid.p_s"].value == (2.1e7,)


def test_other_make_needs_a_supply_pressure(other_make: Machine) -> None:
    document = dict(other_make.document)
    document["fluid"] = {k: v for k, v in document["fluid"].items() if k != "p_s"}
    with pytest.raises(MachineError, match=r"fluid\.p_s: missing \(supply pressure\)"):
        machine_from(document)


def test_every_parameter_carries_unit_source_and_tolerance(tz17: Machine) -> None:
    for parameter in tz17.parameters.values():
        assert parameter.specification.unit and parameter.source
        assert parameter.tolerance in (0.03, 0.10, 0.15, 0.30)
    assert tz17.parameters["cylinder.A_a"].tolerance == 0.03  # high
    assert tz17.parameters["friction.tau_C_pos"].tolerance == 0.30  # low
    assert tz17.parameters["hose_burst_valve.a11"].tolerance == 0.03  # thesis


# --------------------------------------------------------------------------------------------------- changing a machine


def test_changed_values_are_checked_too(tz17: Machine) -> None:
    assert tz17.with_values({"fluid.beta": 1e9}).parameters["fluid.beta"].value == (1e9,)
    with pytest.raises(MachineError, match=r"fluid\.beta: .* is outside"):
        tz17.with_values({"fluid.beta": 1.0})
    with pytest.raises(MachineError, match=r"fluid\.bta: no such parameter; did you mean fluid\.beta"):
        tz17.with_values({"fluid.bta": 1e9})


def test_pair_needs_two_numbers(tz17: Machine) -> None:
    with pytest.raises(MachineError, match=r"kinematics\.att"):
        tz17.with_values({"kinematics.att": (0.4,)})


def test_effects_of_the_file_are_active_and_neutral_ones_are_not(document: dict[str, Any]) -> None:
    document["effects"] = {"payload": {"mass": 120.0}, "pilot_lag": {"r": 1.0}}
    assert machine_from(document).effects == {"payload": {"mass": 120.0}}


def test_machine_survives_the_way_through_a_file(tz17: Machine, tmp_path: Path) -> None:
    path = tmp_path / "copy.yaml"
    path.write_text(yaml.safe_dump(dict(tz17.document)), encoding="utf-8")
    again = load_machine(path)
    assert {k: v.value for k, v in again.parameters.items()} == {k: v.value for k, v in tz17.parameters.items()}


@pytest.mark.parametrize(
    ("pose", "message"),
    [((4.59, 0.0, -1.0), "load"), ((4.59, 0.0, float("nan")), "load"), ((float("inf"), 0.0, 0.0), "finite")],
)
def test_impossible_pose_is_refused(tz17: Machine, pose: tuple[float, float, float], message: str) -> None:
    with pytest.raises(MachineError, match=message):
        tz17.pose(*pose)


def test_pose_that_is_not_tabulated_needs_the_bodies(other_make: Machine) -> None:
    with pytest.raises(MachineError, match=r"rigid_body\.planar is missing.*q3 = 4\.5 rad, q4 = 0 m"):
        other_make.pose(1.0, 0.0)


def test_numbers_wrapped_with_their_unit_are_understood_in_a_pose(document: dict[str, Any]) -> None:
    entry = document["rigid_body"]["configs"]["T1_T2_folded"]
    entry["q3"] = {"value": entry["q3"], "unit": "rad"}
    assert machine_from(document).pose(4.59, 0.0).D0 == 5288.0


def test_no_name_is_no_machine() -> None:
    with pytest.raises(MachineError, match="no machine named; shipped are"):
        load_machine("")


def test_dead_zone_may_not_be_turned_inside_out(document: dict[str, Any]) -> None:
    machine = machine_from(document)
    with pytest.raises(MachineError, match=r"with which main_valve_orifices\.x0 = 0\.1 stays within"):
        machine.with_values({"main_valve_orifices.x0": 0.1}).with_effects({"valve_dead_zone": {"d_extend": -0.2}})


@pytest.mark.parametrize(
    "name", ["", ".", "/dev/zero", "x" * 5000, "machine.yaml", "../machines/tz17", "tz17.yaml", "\0"]
)
def test_a_name_from_outside_is_never_a_path(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "machine.yaml").write_text("meta: {}")
    with pytest.raises(MachineError, match="give its file with --machine") as refused:
        shipped_machine(name)
    assert len(str(refused.value)) < 250
    assert shipped_machine("tz17").name == "tz17"


def test_units_of_the_burst_valves_law_need_not_be_written() -> None:
    document = yaml.safe_load(TZ17)
    for key in ("unit_flow", "unit_pressure", "dp_lin"):
        del document["hose_burst_valve"][key]
    known, left_out = (machine_from(d).parameters for d in (yaml.safe_load(TZ17), document))
    for key in ("unit_flow", "unit_pressure", "dp_lin"):
        name = f"hose_burst_valve.{key}"
        assert left_out[name].value[0] == pytest.approx(known[name].value[0], rel=1e-9)
    with pytest.raises(MachineError, match=r"hose_burst_valve\.unit_flow: write \{value"):
        machine_from({**document, "hose_burst_valve": {**document["hose_burst_valve"], "unit_flow": 1.7e-5}})


def test_a_supply_below_the_tank_s_pressure_is_a_fault(tmp_path: Path) -> None:
    shipped = (resources.files("boom_model") / "machines" / "loader_crane.yaml").read_text(encoding="utf-8")
    text = shipped.replace("p_s:  {value: 2.0e+7", "p_s:  {value: 1.0e+5")
    (tmp_path / "crane.yaml").write_text(text)
    machine, faults = check_machine(tmp_path / "crane.yaml")
    assert machine is None and "fluid.p_s: 100000 Pa is not above the tank's" in faults[0]
