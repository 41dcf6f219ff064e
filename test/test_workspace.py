"""The tree keeps its own rules: what is declared in two places agrees, and nothing of this machine is in it."""

import ast
import importlib.machinery
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path

import pytest

from boom_bringup import cli

ROOT = Path(__file__).resolve().parents[1]
PYTHON_PACKAGES = sorted(path.parent.name for path in ROOT.glob("src/*/setup.py"))
SOURCES = sorted(path for name in PYTHON_PACKAGES for path in (ROOT / "src" / name / name).rglob("*.py"))


# Module -> distribution where they are called differently.
PROVIDED_BY = {
    "boom_input": "boom_model", "google": "protobuf",
    "can": "python-can", "can_remote": "python-can-remote", "pinocchio": "pin", "yaml": "pyyaml",
}  # fmt: skip
# Distribution -> its rosdep key for Ubuntu; None: there is none, package.xml says so in a comment.
ROSDEP_KEYS = {
    "asammdf": None, "h5py": "python3-h5py", "pandas": "python3-pandas", "protobuf": "python3-protobuf",
    "cantools": "python3-cantools-pip", "casadi": None, "dask": None, "distributed": None, "fsspec": None, "pyarrow": None,
    "jinja2": "python3-jinja2", "lz4": None, "markupsafe": "python3-jinja2", "mcap": None, "numba": None,
    "numpy": "python3-numpy", "pin": None, "python-can": "python3-can", "python-can-remote": None,
    "pyyaml": "python3-yaml", "rich": "python3-rich", "rosbags": None, "scipy": "python3-scipy", "zstandard": None,
}  # fmt: skip


def names(path):
    """Read the package names of a requirements file, without versions, extras and case."""
    lines = [line.split("#")[0].strip() for line in path.read_text().splitlines()]
    return {re.split(r"[\[=<>; ]", line)[0].lower().replace("_", "-"): line for line in lines if re.match(r"\w", line)}


def imports(path):
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.split(".")[0])
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "import_module":
            found |= {argument.value.split(".")[0] for argument in node.args if isinstance(argument, ast.Constant)}
    return found


@pytest.mark.parametrize("name", PYTHON_PACKAGES)
def test_manifest_and_setup_agree(name):
    folder = ROOT / "src" / name
    manifest = ElementTree.parse(folder / "package.xml").getroot()
    setup = (folder / "setup.py").read_text()

    assert manifest.findtext("name") == name
    assert f'version="{manifest.findtext("version")}"' in setup
    assert manifest.findtext("license") == "Apache-2.0"
    assert manifest.findtext("export/build_type") == "ament_python"
    assert (folder / "resource" / name).is_file()


@pytest.mark.parametrize("name", PYTHON_PACKAGES)
def test_what_is_imported_is_declared_and_nothing_else(name):
    folder = ROOT / "src" / name
    text = (folder / "package.xml").read_text()
    manifest = ElementTree.fromstring(text)
    depends = {element.text for tag in ("depend", "exec_depend") for element in manifest.findall(tag)}
    by_pip = set(re.split(r",\s*", "".join(re.findall(r"installed with pip: (.*?) -->", text)))) - {""}
    required = set(
        re.findall(r'"([\w-]+)"', re.search(r"install_requires=\[(.*?)\]", (folder / "setup.py").read_text())[1])
    )

    used = set().union(*(imports(path) for path in SOURCES if path.is_relative_to(folder)))
    used |= {module for path in (folder / "boom_input").glob("*.py") for module in imports(path)}
    used = {PROVIDED_BY.get(module, module) for module in used - set(sys.stdlib_module_names)} - {name, "boom_input"}
    python = {module for module in used if module in ROSDEP_KEYS}

    assert used - python - depends == set(), "imported, and not in package.xml"
    assert {ROSDEP_KEYS[module] for module in python} - {None} <= depends
    assert {module for module in python if ROSDEP_KEYS[module] is None} == by_pip
    assert python == required - {"setuptools"}, "imported, and not in setup.py, or the other way round"


def test_the_distribution_requires_what_its_packages_require():
    asked = names(ROOT / "requirements" / "runtime.in")
    for name in PYTHON_PACKAGES:
        required = re.search(r"install_requires=\[(.*?)\]", (ROOT / "src" / name / "setup.py").read_text())[1]
        assert set(re.findall(r'"([\w-]+)"', required)) - {"setuptools"} <= asked.keys()


def test_pip_install_at_the_top_makes_boom_of_all_packages(tmp_path):
    # The back end that pip calls, without its isolated environment: the wheel itself in two seconds.
    code = "import setuptools.build_meta as b, sys; print(b.build_wheel(sys.argv[1]))"
    for part in ("pyproject.toml", "README.md", "LICENSE", "requirements", "src"):
        source, target = ROOT / part, tmp_path / "tree" / part
        target.parent.mkdir(exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__", "test", "build", "*.egg-info"))
        else:
            shutil.copy(source, target)
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], cwd=tmp_path / "tree", capture_output=True, check=True)
    with zipfile.ZipFile(tmp_path / "boom-0.2.0-py3-none-any.whl") as wheel:
        inside = set(wheel.namelist())
        metadata = wheel.read("boom-0.2.0.dist-info/METADATA").decode()
        scripts = wheel.read("boom-0.2.0.dist-info/entry_points.txt").decode()
    assert "Name: boom\nVersion: 0.2.0" in metadata and "Requires-Dist: casadi==" in metadata
    assert "boom = boom_bringup.cli:main" in scripts
    folders = [tmp_path / "tree" / "src" / name for name in PYTHON_PACKAGES]
    modules = {path.relative_to(folder) for folder in folders for path in folder.glob("[bc]*/**/*") if path.is_file()}
    wanted = {str(path) for path in modules if path.parts[0] not in ("build", "resource")}
    assert len(wanted) > 200
    assert wanted - inside == set()


@pytest.mark.parametrize("name", PYTHON_PACKAGES)
def test_every_program_that_is_declared_exists(name):
    for module, function in re.findall(r'"\w+ = ([\w.]+):(\w+)"', (ROOT / "src" / name / "setup.py").read_text()):
        path = ROOT / "src" / name / Path(*module.split(".")).with_suffix(".py")
        assert path.is_file(), f"{name}: {module} does not exist"
        functions = {node.name for node in ast.parse(path.read_text()).body if isinstance(node, ast.FunctionDef)}
        assert function in functions, f"{name}: {module} has no {function}()"


def test_types_are_checked_in_everything_that_does_not_import_rclpy():
    excluded = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["mypy"]["exclude"]

    for path in SOURCES:
        skipped = any(re.search(pattern, str(path.relative_to(ROOT))) for pattern in excluded)
        needs_ros = bool(imports(path) & {"rclpy", "launch", "launch_ros"})
        assert skipped or not needs_ros, f"{path.name} imports rclpy: name it *_node.py, or keep ROS out"


def test_a_core_does_not_import_rclpy():
    shells = re.compile(r"_node\.py$|_action\.py$|\.launch\.py$")

    for path in SOURCES:
        if "boom_node" not in path.parts and not shells.search(path.name):
            assert "rclpy" not in imports(path), f"{path} is a core"


def test_yaml_comes_in_by_one_way():
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text())):
            called = node.func if isinstance(node, ast.Call) else None
            if isinstance(called, ast.Attribute) and isinstance(called.value, ast.Name) and called.value.id == "yaml":
                reads = called.attr.removeprefix("safe_").startswith(("load", "parse", "scan", "compose", "full_load"))
                assert not reads, f"{path}:{node.lineno}: use boom_input.yaml_text, which has limits"


def test_the_interfaces_build_with_what_the_lock_holds():
    folder = ROOT / "requirements"
    project = tomllib.loads((ROOT / "src/boom_interfaces/pyproject.toml").read_text())
    asked = {
        line.split("[")[0].split("=")[0].lower().replace("_", "-"): line for line in project["build-system"]["requires"]
    }
    listed = names(folder / "build.in")

    assert asked == {name: line for name, line in listed.items() if name not in ("setuptools", "wheel")}


@pytest.mark.parametrize("lock, inputs", [
    ("workspace.lock", ["runtime.in", "dev.in"]), ("build.lock", ["build.in"]), ("bootstrap.lock", ["bootstrap.in"]),
])  # fmt: skip
def test_locks_hold_what_is_asked_for_with_hashes_and_no_address(lock, inputs):
    text = (ROOT / "requirements" / lock).read_text()
    locked = names(ROOT / "requirements" / lock)

    for name, line in {k: v for file in inputs for k, v in names(ROOT / "requirements" / file).items()}.items():
        assert locked[name].split(";")[0].strip(" \\").split("==")[1] == line.split("==")[1]
    assert all("--hash=sha256:" in entry for entry in re.split(r"\n(?=\w)", text.strip()))
    assert "://" not in text


def test_nothing_of_a_machine_is_in_the_tree():
    suffixes = {".py", ".md", ".toml", ".yaml", ".yml", ".xml", ".cfg", ".lock", ".in", ".txt", ".urdf", ".cmake", ""}
    wrong = re.compile(r"/(root|work|home/\w+)/|(?<![\w.])/tmp/\w|https?://[^/\s]*(pypi|simple|artifact|registry)")

    for path in listed_files():
        if path.suffix in suffixes and path != Path(__file__).resolve():
            found = wrong.search(path.read_text(errors="ignore"))
            # A made-up home of a made-up user in a test is nobody's machine.
            assert not found or "/home/user/" in found.group(), f"{path.relative_to(ROOT)} holds {found.group()}"


def listed_files():
    """Give the files that git would take: tracked, and new ones that are not ignored."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if result.returncode:
        pytest.skip("the tree was unpacked without .git: which files belong to it is not known")
    return [ROOT / name for name in result.stdout.split("\0") if name and (ROOT / name).is_file()]


def test_recordings_that_the_docs_rely_on_are_there_and_small():
    bags = sorted(path.parent.relative_to(ROOT / "bags") for path in (ROOT / "bags").rglob("metadata.yaml"))

    assert {str(path.parent) for path in bags} == {"damaged", "explained", "healthy", "unexplained"}
    assert len(bags) == 15
    assert sum(path.stat().st_size for path in (ROOT / "bags").rglob("*") if path.is_file()) < 13e6


class TestLauncher:
    """`./boom` itself, without setting anything up."""

    @pytest.fixture
    def tree(self, tmp_path):
        """A copy of what the launcher needs, without `.venv`."""
        shutil.copy(ROOT / "boom", tmp_path / "boom")
        for name in (
            "requirements",
            "src/boom_bringup/boom_bringup",
            "src/boom_interfaces",
            "src/boom_model/boom_input",
            "src/boom_model/boom_model",
            "src/boom_controller/boom_controller",
        ):
            shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
        return tmp_path

    @staticmethod
    def run(tree, *arguments, **variables):
        environment = {"PATH": os.environ["PATH"], **variables}
        base = getattr(sys, "_base_executable", sys.executable)
        return subprocess.run(
            [base, str(tree / "boom"), *arguments], env=environment, capture_output=True, text=True, check=False
        )

    def test_help_and_version_need_no_set_up(self, tree):
        shown = self.run(tree, "--help")
        assert (shown.returncode, shown.stderr) == (0, "")
        assert "./boom COMMAND" in shown.stdout
        assert self.run(tree, "--version").stdout.startswith("boom ")
        assert not (tree / ".venv").exists()

    def test_every_command_is_explained_before_anything_is_installed(self, tree):
        for name in cli.command_names():
            shown = self.run(tree, name, "--help")
            assert (shown.returncode, shown.stderr) == (0, "")
            assert f"usage: ./boom {name}" in shown.stdout
        assert not (tree / ".venv").exists()

    def test_a_command_of_two_words_is_a_command_and_not_a_question(self, tree):
        # Without a compiler the set-up, which every command begins with, ends at once.
        assert "this computer lacks g++" in self.run(tree, "import-can", "log", PATH=str(tree)).stderr

    def test_a_misspelt_command_does_not_start_a_set_up(self, tree):
        result = self.run(tree, "tset")
        assert (result.returncode, result.stderr) == (2, "boom: unknown command tset: did you mean test?\n")
        assert not (tree / ".venv").exists()

    def test_a_missing_compiler_is_named_before_anything_is_made(self, tree):
        result = self.run(tree, "setup", PATH=str(tree))
        assert result.returncode == 2
        assert "this computer lacks g++: sudo apt install g++" in result.stderr
        assert not (tree / ".venv").exists()

    def test_an_impossible_setting_is_one_line(self, tree):
        result = self.run(tree, "setup", BOOM_NETWORK="wan")
        assert (result.returncode, result.stderr.count("\n")) == (2, 1)
        assert "BOOM_NETWORK=wan" in result.stderr

    def test_a_sourced_ros_is_named_with_the_way_to_use_it(self, tree):
        result = self.run(tree, "setup", PATH=str(tree), AMENT_PREFIX_PATH="/opt/ros/jazzy", ROS_DISTRO="jazzy")
        assert "ROS 2 jazzy (/opt/ros/jazzy) is sourced; ./boom ignores it" in result.stderr.splitlines()[0]
        assert "colcon build" in result.stderr.splitlines()[0]

    def test_an_environment_that_is_in_use_is_not_removed(self, tree):
        module = self.load(tree)
        link = tree / ".venv" / "bin" / "python"
        link.parent.mkdir(parents=True)
        link.symlink_to(getattr(sys, "_base_executable", sys.executable))
        code = "print('up', flush=True); input()"
        with subprocess.Popen(
            [str(link), "-I", "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as user:
            user.stdout.readline()
            with pytest.raises(module.SetupError, match=f"processes run from it \\({user.pid}\\)"):
                module.remove_venv()
            user.communicate("\n")
        assert link.exists()

    def test_an_environment_that_was_moved_is_recognised(self, tree):
        module = self.load(tree)
        base = getattr(sys, "_base_executable", sys.executable)
        made = tree / ".venv"
        subprocess.run([base, "-m", "venv", "--without-pip", str(made)], check=True)
        # pip itself takes seconds to install and does not matter here.
        next(made.glob("lib/python3*/site-packages")).joinpath("pip.py").touch()
        (made / "bin" / "pip").write_text(f"#!{made}/bin/python\n")
        assert module.venv_is_usable()

        moved = tree / "moved"
        moved.mkdir()
        made.rename(moved / ".venv")
        module.VENV, module.PYTHON = moved / ".venv", moved / ".venv" / "bin" / "python"
        assert not module.venv_is_usable()

    def test_a_stage_is_done_again_when_its_inputs_change(self, tree):
        module = self.load(tree)
        stage = module.Stage("x", "x", module.digest(tree / "requirements"), lambda: None)
        stage.mark()
        assert stage.is_done()
        (tree / "requirements" / "workspace.lock").write_text("changed")
        assert not module.Stage("x", "x", module.digest(tree / "requirements"), lambda: None).is_done()

    def test_only_the_stages_that_depend_on_a_file_are_done_again(self, tree):
        module = self.load(tree)

        def keys():
            return {stage.name: stage.key for stage in module.make_stages(None)}

        def changed(path):
            before = keys()
            path.write_text(path.read_text() + "# changed\n")
            return [name for name, key in keys().items() if before[name] != key]

        assert changed(tree / "src/boom_bringup/boom_bringup/cli.py") == []
        assert changed(tree / "src/boom_interfaces/msg/GroundTruth.msg") == ["interfaces", "workspace"]
        assert changed(tree / "requirements/workspace.lock") == ["packages", "interfaces", "workspace"]
        assert changed(tree / "requirements/bootstrap.lock") == ["uv", "packages", "interfaces", "workspace"]

    @staticmethod
    def load(tree):
        loader = importlib.machinery.SourceFileLoader(f"launcher_{tree.name}", str(tree / "boom"))
        spec = importlib.util.spec_from_loader(loader.name, loader)
        module = importlib.util.module_from_spec(spec)
        loader.exec_module(module)
        return module


def test_no_test_depends_on_chance() -> None:
    import hypothesis

    assert hypothesis.settings.default is not None and hypothesis.settings.default.derandomize


# Decision logic that one likelihood will replace: it moved as it was.
LONGER = {"answer.py", "hypotheses.py"}


def test_no_file_is_longer_than_a_reader_keeps_in_mind():
    long = [path.name for path in SOURCES if len(path.read_text().splitlines()) > 400]
    assert set(long) == LONGER


def test_a_class_name_stands_for_one_thing():
    where: dict[str, list[str]] = {}
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef):
                where.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    assert {name: paths for name, paths in where.items() if len(paths) > 1} == {}
