"""Writes recordings as other laboratories do: CSV, MAT, MF4, rosbag2 .db3, ROS 1, MCAP, OPERA; with wrong units and signs.

Independent of `boom_import`: every file is written with the library that its laboratory would use, from a recording that is known.

  ./boom python benchmarks/foreign_recordings.py FOLDER [--bag BAG]
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import h5py
import numpy as np
import scipy.io
from asammdf import MDF, Signal
from foreign_bags import db3_renamed, mcap_json, mcap_own_type_flipped_gyro, opera, ros1_wrong_units
from foreign_data import ATMOSPHERE, BEGIN, DEG, Data, data_of, rng

__all__ = ["ATMOSPHERE", "DEG", "KINDS", "Data", "data_of", "table", "write"]


def table(path, header, columns, separator=",", decimal=".", encoding="utf-8", above=(), digits=6, units=None):
    """Write a CSV file of a dialect."""
    with path.open("w", newline="", encoding=encoding) as file:
        file.writelines(line + "\r\n" for line in above)
        out = csv.writer(file, delimiter=separator)
        out.writerow(header)
        if units:
            out.writerow(units)
        for row in zip(*columns, strict=True):
            cells = [v if isinstance(v, str) else f"{v:.{digits}f}" for v in row]
            out.writerow(
                [
                    c.replace(".", ",") if decimal == "," and c[:1] in "-0123456789" and ":" not in c else c
                    for c in cells
                ]
            )


def csv_german(d, folder):
    """German headers, decimal commas, a preamble, Windows' encoding."""
    path = folder / "Messung_03.csv"
    header = ["Zeit [ms]", "Winkel Ausleger [°]", "Winkelgeschwindigkeit [°/s]", "Druck Kolbenseite [bar]",
              "Druck Stangenseite [bar]", "Strom Heben [mA]", "Strom Senken [mA]", "Öltemperatur [°C]"]  # fmt: skip
    above = ["Messprotokoll Kran 3;;;;;;;", "Prüfer: M. Huber;;;;;;;", ""]
    columns = [d.t * 1e3, d.q * DEG, d.w * DEG, d.ph / 1e5, d.pb / 1e5, d.ie * 1e3, d.ir * 1e3, d.temperature]
    table(path, header, columns, ";", ",", "cp1252", above, digits=4)
    return [path]


def csv_iso_psi(d, folder):
    """ISO dates, psi, no gyro, a pressure that is no signal."""
    path = folder / "run_2025-06-03.csv"
    stamps = [s.isoformat(timespec="milliseconds").replace("+00:00", "Z") for s in d.dates]
    header = [
        "timestamp",
        "boom_angle_deg",
        "bottom_pressure_psi",
        "rod_pressure_psi",
        "raise_solenoid_mA",
        "lower_solenoid_mA",
        "supply_pressure_psi",
    ]
    columns = [
        stamps,
        d.q * DEG,
        d.ph / 6894.757293,
        d.pb / 6894.757293,
        d.ie * 1e3,
        d.ir * 1e3,
        d.supply / 6894.757293,
    ]
    table(path, header, columns)
    return [path]


def csv_excel_opaque(d, folder):
    """Excel's dates, a line of units, the angle counted downwards, absolute MPa."""
    path = folder / "export.txt"
    days = (np.array(d.ns) / 1e9) / 86400 + 25569.0
    header = ["Date", "phi", "dphi", "pA", "pB", "I_Y1a", "I_Y1b"]
    units = ["d", "deg", "deg/s", "MPa abs", "MPa abs", "A", "A"]
    columns = [
        [f"{v:.10f}" for v in days],
        -d.q * DEG,
        -d.w * DEG,
        (d.ph + ATMOSPHERE) / 1e6,
        (d.pb + ATMOSPHERE) / 1e6,
        d.ie,
        d.ir,
    ]
    table(path, header, columns, "\t", units=units)
    return [path]


def mat_struct(d, folder):
    """A struct with the letters of formulae, no units."""
    path = folder / "boom_test7.mat"
    log = {"t": d.t, "q": d.q, "dq": d.w, "p_A": d.ph, "p_B": d.pb, "i_ext": d.ie, "i_ret": d.ir, "p_pump": d.supply}
    scipy.io.savemat(path, {"log": log, "Ts": 0.01, "comment": "inner boom, extended"})
    return [path]


def mat_v73(d, folder):
    """One matrix with cells of names and units, absolute kPa."""
    path = folder / "messdaten_v73.mat"
    names = ["Zeit", "Hubwinkel", "Drehrate", "p_Boden_abs", "p_Ring_abs", "I_Ausfahren", "I_Einfahren", "T_Oel"]
    units = ["s", "rad", "rad/s", "kPa", "kPa", "A", "A", "degC"]
    columns = [d.t, d.q, d.w, (d.ph + ATMOSPHERE) / 1e3, (d.pb + ATMOSPHERE) / 1e3, d.ie, d.ir, d.temperature]
    with h5py.File(path, "w", userblock_size=512) as file:
        made = file.create_dataset("data", data=np.array(columns))
        made.attrs["MATLAB_class"] = np.bytes_("double")
        for label, texts in (("names", names), ("units", units)):
            references = []
            for i, text in enumerate(texts):
                one = file.create_dataset(f"#refs#/{label}{i}", data=np.array([[ord(c)] for c in text], np.uint16))
                one.attrs["MATLAB_class"] = np.bytes_("char")
                references.append(one.ref)
            cell = file.create_dataset(label, data=np.array(references, dtype=h5py.ref_dtype).reshape(-1, 1))
            cell.attrs["MATLAB_class"] = np.bytes_("cell")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return [path]


def mf4_signed(d, folder):
    """Groups sampled at times of their own, one signed current, bar."""
    path = folder / "kran_0042.mf4"

    def group(file, delay, *channels):
        t = d.t[:-1] + delay
        file.append([Signal(np.interp(t, d.t, values), t, unit, name) for values, unit, name in channels])

    with MDF(version="4.10") as file:
        file.start_time = BEGIN
        group(file, 0.003, (d.temperature, "degC", "Oil_Temp"), (d.supply / 1e5, "bar", "Pump_Pressure"))
        group(file, 0.002, (d.ph / 1e5, "bar", "Cyl_Press_Piston"), (d.pb / 1e5, "bar", "Cyl_Press_Rod"))
        group(file, 0.001, (d.q * DEG, "deg", "Boom_Angle"), (d.w * DEG, "deg/s", "Boom_AngVel"))
        group(file, 0.0, (np.where(d.ie >= d.ir, d.ie, -d.ir) * 1e3, "mA", "Boom_Valve_Current"))
        file.save(path, overwrite=True)
    return [path]


def csv_percent(d, folder):
    """The valve's command in percent: how many amperes those are is in no file. Has to be asked."""
    path = folder / "plc_trace.csv"
    header = ["Time (s)", "Boom angle (deg)", "Pressure A (bar)", "Pressure B (bar)", "Valve command (%)"]
    table(path, header, [d.t, d.q * DEG, d.ph / 1e5, d.pb / 1e5, (d.ie - d.ir) / 0.6 * 100], digits=3)
    return [path]


def csv_nameless(d, folder):
    """Numbers without a name or unit, the angle counted downwards: nothing says which direction is up. Has to be asked."""
    path = folder / "log.dat"
    with path.open("w") as file:
        for row in zip(
            d.t, d.ir, d.ie, -d.q * DEG, d.ph / 1e5, d.pb / 1e5, d.ph / 1e5 + rng.normal(0, 0.3, len(d.t)), strict=True
        ):
            file.write(" ".join(f"{v:.5f}" for v in row) + "\n")
    return [path]


KINDS = {function.__name__: function for function in (
    csv_german, csv_iso_psi, csv_excel_opaque, mat_struct, mat_v73, mf4_signed, db3_renamed, ros1_wrong_units,
    mcap_own_type_flipped_gyro, mcap_json, opera, csv_percent,
)}  # fmt: skip
MORE = {"csv_nameless": csv_nameless}
ASKS = ("csv_percent", "csv_nameless")
"""What cannot be told from the file and has to be asked."""


def write(kind, bag, folder):
    """One foreign recording of the kind in `folder`. Returns its files."""
    folder.mkdir(parents=True, exist_ok=True)
    return {**KINDS, **MORE}[kind](data_of(bag), folder)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--bag", default="bags/healthy/extended")
    args = parser.parse_args()
    for name in (*KINDS, *MORE):
        print(*write(name, args.bag, args.folder / name))
