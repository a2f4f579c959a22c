"""Study files: what they hold is read, and every fault is named with its place before anything runs."""

import pytest

from hevopt.errors import DataError
from hevopt.files.lookup import shipped_folder
from hevopt.sweeps.plan.designs import cars_of, designs_of
from hevopt.sweeps.plan.jobs import jobs_of
from hevopt.sweeps.plan.parameters import Range
from hevopt.sweeps.plan.study_file import read_study

HEAD = 'architecture = "C2"\ncycles = ["nedc"]\nstrategies = ["ecms", "dp"]\n'


@pytest.fixture
def study(tmp_path):
    """Text -> the study read from it."""

    def read(text: str):
        path = tmp_path / "study.toml"
        path.write_text(text)
        return read_study(path)

    return read


@pytest.fixture
def fault(study):
    """Text -> the message that refuses it, without the folder."""

    def read(text: str) -> str:
        with pytest.raises(DataError) as found:
            study(text)
        message = str(found.value)
        assert "study.toml" in message.split("\n")[0]
        return message[message.index("study.toml") :]

    return read


def test_a_study_is_read_in_the_order_of_the_file(study):
    found = study(
        HEAD
        + """constraints = ["battery.cells_in_series * 730 >= machine.power_max_w"]
[parameters]
nox_weight = [0, 10]
battery.cells_in_series = { from = 32, to = 96, count = 9 }
machine.power_max_w = { from = 8e3, to = 3e4, count = 10, log = true }
engine = ["engine_diesel_1600", "engine_diesel_1600_steep_nox"]
"engine.idle_rpm" = [800, 850.5]
coupling.second_clutch = [true, false]
[sample]
method = "sobol"
count = 256
seed = 1
"""
    )
    assert list(found.parameters.items()) == [
        ("nox_weight", (0.0, 10.0)),
        ("battery.cells_in_series", Range(32, 96, 9, False)),
        ("machine.power_max_w", Range(8e3, 3e4, 10, True)),
        ("engine", ("engine_diesel_1600", "engine_diesel_1600_steep_nox")),
        ("engine.idle_rpm", (800, 850.5)),
        ("coupling.second_clutch", (True, False)),
    ]
    assert all(isinstance(weight, float) for weight in found.parameters["nox_weight"])
    assert found.architecture == "C2" and found.cycles == ("nedc",)
    assert found.strategies == ("ecms", "dp") and found.allow_shortfall is False
    assert (found.sample.method, found.sample.count, found.sample.seed) == ("sobol", 256, 1)
    assert found.constraints[0].names == {"battery.cells_in_series", "machine.power_max_w"}


def test_paths_are_relative_to_the_study_and_names_are_shipped_ones(study, tmp_path, monkeypatch):
    (tmp_path / "sub").mkdir()
    for kind, name in (("architectures", "C2.toml"), ("cycles", "nedc.csv")):
        text = (shipped_folder(kind) / name).read_text()
        (tmp_path / "sub" / f"my_{name}").write_text(text)
    (tmp_path / "C2.toml").write_text("not = 'a car'")  # a name never means a file beside the study
    monkeypatch.chdir("/")
    found = study(
        'architecture = "sub/my_C2.toml"\ncycles = ["sub/my_nedc.csv", "udds"]\n'
        'strategies = ["bound"]\n[parameters]\nnox_weight = [0]'
    )
    assert found.architecture == str(tmp_path / "sub" / "my_C2.toml")
    assert found.cycles == (str(tmp_path / "sub" / "my_nedc.csv"), "udds")
    assert study(HEAD + "[parameters]\nnox_weight = [0]").architecture == "C2"


def test_every_wrong_key_and_value_is_reported_at_once_with_its_place_in_the_study(fault):
    message = fault(
        'architecture = "C2"\ncycles = ["nedcc"]\nstrategies = ["dpp", "bound", "bound"]\n'
        'constraints = ["machine.power_max < 3"]\n[parameters]\nmachine.power_w = [1, 2]\n'
        "machine.power_max_w = { from = -1, to = 2e4, count = 3 }\n"
        "battery.cells_in_series = [32, 48.5, 64]\n"
        'engine = ["engine_diesel_1600", "engine_diesel"]\nnox_weight = [0, -1]\n'
    )
    assert message.startswith("study.toml: 9 faults\n")
    for words in (
        "cycles: cycle 'nedcc' not found; close matches: nedc;",
        "strategies: strategy 'dpp' not found; close matches: dp",
        "strategies: 'bound' is given twice",
        "constraints: constraint 'machine.power_max < 3': parameter 'machine.power_max' not found; close matches",
        "parameters.machine.power_w = 1: ",
        "parameters.machine.power_max_w = -1: ",
        "parameters.battery.cells_in_series = 48.5: ",
        "parameters.engine = 'engine_diesel': ",
        "parameters.nox_weight = -1.0; allowed: 0 to 1e+06",
    ):
        assert words in message
    assert "unknown key power_w; close matches: power_max_w" in message
    assert "power_max_w = -1; allowed" in message and "whole number" in message


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("{ from = 2, to = 1, count = 3 }", "from 2 must be below to 1"),
        ("{ from = 1, to = 1, count = 3 }", "from 1 must be below to 1"),
        ("{ from = 0, to = 1, count = 3, log = true }", "must be 1e-15 or more where log is true"),
        ("{ from = 1, to = 2, count = 1 }", "count = 1; allowed: 2 to 1e+06"),
        ("{ from = 1, to = 2, count = 2.5 }", "count = 2.5: a whole number is needed"),
        ("{ from = 1, to = 2 }", "count is missing"),
        ("{ to = 2, count = 3 }", "from is missing"),
        ("{ from = 1, to = 2, cuont = 3 }", "unknown key cuont; close matches: count"),
        ("{ from = nan, to = 2, count = 3 }", "from = nan: allowed: -1e+15 to 1e+15"),
        ("{ from = 1, to = inf, count = 3 }", "to = inf: allowed: -1e+15 to 1e+15"),
        ("{ from = true, to = 2, count = 3 }", "from = true: a number is needed"),
        ("{}", "from is missing"),
        ("2e4", "a list [...] or a range { from = , to = , count = } is needed"),
        ("[]", "0 entries; needed: 1 to 10000"),
        ("[1, nan]", "allowed: -1e+15 to 1e+15"),
        ('[1, "2"]', "entries must be all numbers, all texts in quotes, or all true or false"),
        ("[1, true]", "entries must be all numbers, all texts in quotes, or all true or false"),
        ("[[1], [2]]", "entries must be all numbers, all texts in quotes, or all true or false"),
        ("[2, 1, 2.0]", "2.0 is given twice"),
        ("[true, false]", "a number is needed"),
    ],
)
def test_a_wrong_list_or_range_is_refused_with_what_is_allowed(fault, value, words):
    message = fault(f"{HEAD}[parameters]\nmachine.power_max_w = {value}\n")
    assert "parameters.machine.power_max_w" in message and words in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "nothing to vary; add the table [parameters]"),
        ("[parameters]", "nothing to vary; add the table [parameters]"),
        ("parameters = 3", "a table [parameters] is needed"),
        ('strategie = ["dp"]\n[parameters]\nnox_weight = [0]', "unknown key strategie"),
        ("[parameters]\nnox_weight = ['a']", "parameters.nox_weight = 'a'; allowed: 0 to 1e+06"),
        ("[parameters]\nnox_weight = [true]", "parameters.nox_weight = true; allowed: 0 to 1e+06"),
        (
            "[parameters]\nnox_weight = [0]\n[sample]\nmethod = 'sobol'\ncount = 0",
            "sample.count = 0; allowed: 1 to 1e+06",
        ),
        (
            "[parameters]\nnox_weight = [0]\n[sample]\nmethod = 'halton'\ncount = 9",
            "sample.method = 'halton': allowed: 'sobol' or 'latin_hypercube'",
        ),
        (
            "[parameters]\nnox_weight = [0]\nconstraints = ['nox_weight < 3']",
            "parameters.constraints: constraints is a key of the whole file; write it above",
        ),
        (
            "[parameters]\nmachine.power_max_w = [1e4]\n'machine.power_max_w' = [2e4]",
            "'machine.power_max_w' is given twice",
        ),
        ("[parameters]\n" + ".".join("a" * 12) + " = [1]", "nested too deeply"),
        ("[parameters]\n'machine.' = [1]\n", "parameters.machine. = 1"),
    ],
)
def test_a_wrong_table_is_refused_with_what_is_allowed(fault, text, words):
    assert words in fault(HEAD + text)


def test_strategies_must_fit_the_functions_of_the_architecture(fault, study):
    text = (
        'architecture = "A"\ncycles = ["nedc"]\nstrategies = [{}]\n[parameters]\nnox_weight = [0]'
    )
    message = fault(text.format('"ecms"'))
    assert "strategies: ecms does not fit A; allowed: baseline, bound" in message
    assert study(text.format('"baseline", "bound"')).strategies == ("baseline", "bound")


def test_two_cycles_of_one_name_are_refused_with_what_to_do(fault, tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "nedc.csv").write_bytes(
            (shipped_folder("cycles") / "nedc.csv").read_bytes()
        )
    for names in ('"nedc", "a/nedc.csv"', '"a/nedc.csv", "b/nedc.csv"'):
        text = HEAD.replace('"nedc"', names) + "[parameters]\nnox_weight = [0]"
        listed = names.replace('"', "")
        message = fault(text)
        assert f"cycles: 2 files have the name 'nedc': {listed};" in message
        assert "rename a file, or leave one out" in message
    text = HEAD.replace('"nedc"', '"nedc", "nedc"') + "[parameters]\nnox_weight = [0]"
    assert "cycles: 'nedc' is given twice; give it once" in fault(text)


def test_components_are_relative_to_the_study_and_shown_as_written(
    study, fault, tmp_path, monkeypatch
):
    monkeypatch.chdir("/")
    engine = shipped_folder("architectures") / "components" / "engine_diesel_1600.toml"
    (tmp_path / "my_engine.toml").write_bytes(engine.read_bytes())
    text = (
        HEAD
        + """constraints = ["engine == './my_engine.toml'"]
[parameters]
engine = ["./my_engine.toml", "engine_diesel_1600"]
"""
    )
    designs = designs_of(study(text))
    (design,) = designs
    assert design.values == {"engine": "./my_engine.toml"}
    assert design.changes == {"engine": str(tmp_path / "my_engine.toml")}
    (car,) = cars_of(study(text), designs)
    assert tmp_path / "my_engine.toml" in car.files
    (jobs, _), (shipped_jobs, _) = (
        next(jobs_of("C2", ["nedc"], ["bound"], [(c, [(0, 0.0)])]))
        for c in (design.changes, {"engine": "engine_diesel_1600"})
    )
    assert jobs.inputs == shipped_jobs.inputs
    message = fault(text.replace('my_engine.toml"', 'my_engin.toml"'))
    assert "parameters.engine = './my_engin.toml'" in message and "does not exist" in message


def test_a_value_that_is_allowed_only_together_with_another_parameter_is_no_fault(study, fault):
    start = "[parameters]\nbattery.soc.start = [0.5, 0.85]\n"
    assert "start 0.85 must lie in [0.4, 0.8]" in fault(HEAD + start)
    assert study(HEAD + start + "battery.soc.max = [0.7, 0.9]\n").parameters["battery.soc.start"]


def test_a_sample_needs_no_count_of_a_range(study):
    text = "[parameters]\nmachine.power_max_w = { from = 1e4, to = 2e4 }\n"
    sample = "[sample]\nmethod = 'latin_hypercube'\ncount = 5\n"
    assert study(HEAD + text + sample).parameters["machine.power_max_w"].count is None
