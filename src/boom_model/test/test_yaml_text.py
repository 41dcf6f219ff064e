import time
from pathlib import Path

import pytest
import yaml

from boom_input.files import InputError, read_text
from boom_input.shown import printable, quoted
from boom_input.yaml_text import line_of, parse_yaml, read_yaml

ALIAS_BOMB = "a: &a [x, x]\n" + "".join(
    f"{chr(98 + i)}: &{chr(98 + i)} [*{chr(97 + i)}, *{chr(97 + i)}]\n" for i in range(24)
)


def test_plain_documents_become_what_they_say():
    assert parse_yaml("a: 1\nb: [1.5, true, null, text]\nc: {d: 2024-13-45}\n", "f.yaml") == {
        "a": 1, "b": [1.5, True, None, "text"], "c": {"d": "2024-13-45"},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        (ALIAS_BOMB, 2, "aliases"),
        ("a: &a {b: 1}\nc:\n  <<: *a\n", 3, "aliases"),
        ("[" * 100_000, 1, "nested deeper"),
        ("{a: " * 100_000, 1, "nested deeper"),
        ("- " * 100_000, 1, "nested deeper"),
        ("a: " + "9" * 5000, 1, "5000 digits"),
        ("a: 1\nb: -" + "9" * 5000 + ".5e3", 2, "digits"),
        ("a: !!python/object:os.system x", 1, "tag"),
        ("a: !!timestamp 2024-13-45", 1, "tag"),
        ("a: !!int word", 1, "tag"),
        ("a: 0x_", 1, "not readable as YAML"),
        ("a: 0\nb: 017", 2, "base of 8"),
        ("a: 0x5F5E1000", 1, "base of 2 or 16"),
        ("a: 1:30", 1, "base of 8 or 60"),
        ("a: 1\n? " + "k" * 100_000 + "\n: 1\n", 2, "cannot be a key"),
        ('a: 1\n"k\\e[2J": 1\n', 2, "cannot be a key"),
        ('a: "name \\e[2J"', 1, "the character \\x1b in a text"),
        ("".join(f"%TAG !{i}! x:{i}\n" for i in range(40_000)), 1, "directive"),
        ("a: 1\n---\nb: 2\n", 2, "second document"),
        ("a: 1\na: 2\n", 2, "a is given twice"),
        ("? [a, b]\n: 1\n", 1, "single word"),
        ("a: 1\n\tb: 2\n", 2, "not readable as YAML"),
        ("a: \x00", 1, "not readable as YAML"),
        ("a: \x1b[31m", 1, "not readable as YAML"),
        ("".join(f"k{i}: 1\n" for i in range(60_000)), 49_999, "values"),
    ],
    ids=lambda value: "" if isinstance(value, str) and len(value) > 20 else None,
)
def test_hostile_documents_are_refused_in_one_line_with_file_and_line(text, line, words):
    begin = time.monotonic()
    with pytest.raises(InputError) as caught:
        parse_yaml(text, "f.yaml")
    message = str(caught.value)
    assert words in message
    assert message.startswith((f"f.yaml, line {line}: ", "f.yaml: "))
    assert "\n" not in message and len(message) < 400 and message.isprintable()
    assert time.monotonic() - begin < 2.0


def test_keys_are_texts_and_dates_and_merge_keys_too():
    assert parse_yaml("1: a\nnull: b\non: c\n<<: {d: 1}\n2024-01-01: e\n", "f.yaml") == {
        "1": "a", "null": "b", "on": "c", "<<": {"d": 1}, "2024-01-01": "e",
    }  # fmt: skip
    assert parse_yaml("", "f.yaml") is None and parse_yaml("!!str 5", "f.yaml") == "5"


def test_shipped_files_are_read_as_yaml_itself_reads_them():
    packages = Path(__file__).parents[2]
    for path in sorted(packages.glob("*/*/**/*.yaml")):
        assert read_yaml(path, hexadecimal=True) == yaml.safe_load(path.read_text()), path


def test_a_place_in_a_document_has_a_line():
    text = "a:\n  b: [1,\n    {c: 2}]\n  d:\n    e: 1\n"
    assert [line_of(text, keys.split(".")) for keys in ("a", "a.b", "a.d.e", "a.d.x", "x")] == [1, 2, 5, 4, None]


def test_a_file_of_more_than_a_megabyte_a_device_and_a_fifo_are_refused_at_once(tmp_path):
    import os

    large, fifo = tmp_path / "large.yaml", tmp_path / "fifo.yaml"
    large.write_text("a: " + "x" * 1_000_001)
    os.mkfifo(fifo)
    for path, words in (
        (large, "larger than 1 MB"),
        (fifo, "regular"),
        (Path("/dev/zero"), "regular"),
        (tmp_path, "regular"),
    ):
        with pytest.raises(InputError, match=words):
            read_yaml(path)
    with pytest.raises(InputError, match="No such file"):
        read_text(tmp_path / "none.yaml")
    with pytest.raises(InputError, match="cannot be read"):
        read_text("nul\0in name")


def test_what_a_terminal_would_obey_is_written_out():
    assert printable("a\x1b[31mb\u202ec\udc80") == "a\\x1b[31mb\\u202ec\\udc80"
    assert printable("Länge 5 µm") == "Länge 5 µm"
    assert quoted("begin\n" + "x" * 1_000_000 + " the end", 20) == "begin xxxxx...he end"
