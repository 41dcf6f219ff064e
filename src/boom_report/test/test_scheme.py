"""One drawing of the hydraulic scheme: it shows what the machine file has, coloured by evidence where there is any."""

import re

import pytest

from boom_model.catalogue import SUBSYSTEM_NAMES
from boom_model.machine_file import shipped_machine
from boom_report import palette
from boom_report.scheme import heat, scheme


@pytest.mark.parametrize(
    ("machine", "absent", "said"),
    [
        ("tz17", set(), "hose burst valve"),
        ("triangle_direct", {"accumulators", "hose_burst_valve", "pilot_valves"}, "cylinder"),
        ("loader_crane", {"accumulators", "pilot_valves"}, "load-holding valve"),
    ],
)
def test_what_the_machine_file_does_not_have_is_not_drawn(machine, absent, said):
    drawing = scheme(shipped_machine(machine))
    drawn = set(re.findall("id='scheme-([a-z_]+)'", drawing))
    assert drawn == set(SUBSYSTEM_NAMES) - absent
    assert f">{said}</text>" in drawing or f">{said}\n" in drawing
    assert "probability" not in drawing


def test_evidence_colours_a_subsystem_and_draws_one_that_the_file_lacks_dashed():
    drawing = scheme(shipped_machine("triangle_direct"), {"hose_burst_valve": 0.93, "main_valve": 0.3})
    part = re.search(r"id='scheme-hose_burst_valve'.*?</g>", drawing, re.S).group()
    assert "heat-4" in part and "0.93" in part and "not in the machine file" in part
    assert "class='part heat-4 absent'" in drawing and drawing.count("absent") == 1
    assert "0.00" not in re.sub(r"<title>.*?</title>", "", drawing)
    assert "Hydraulic scheme. hose burst valve 0.93, main valve 0.30." in drawing
    lightness = [
        sum(int(palette.light(f"heat-{heat(p)}")[k : k + 2], 16) for k in (1, 3, 5)) for p in (0.0, 0.1, 0.3, 0.6, 0.9)
    ]
    assert lightness == sorted(lightness, reverse=True)


def test_an_effect_that_holds_the_load_is_drawn_as_the_valve_that_does():
    machine = shipped_machine("triangle_direct")
    holding = machine.with_effects({"load_holding_valve": {"p_set": 1.4e7, "R": 3.0}})
    assert "load-holding valve" in scheme(holding) and "load-holding valve" not in scheme(machine)


def test_a_spool_that_vents_its_ports_is_drawn_with_both_led_to_the_tank():
    machine = shipped_machine("loader_crane")
    vented = machine.with_effects({"vented_neutral": {"A_v": 5e-6}})
    both = "M294 542V563H320M320 542V584"
    assert both in scheme(vented) and both not in scheme(machine)
