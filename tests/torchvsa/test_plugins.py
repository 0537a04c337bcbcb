"""Plugins are imported when a registry needs them, once, and a broken one takes nothing down."""

from pathlib import Path

import pytest
from packages import install, python

SOUND = """
import torchvsa
from torchvsa import ARCHITECTURES, MAP
print("sound is imported")
# Looked up while plugins are being imported.
assert "nothing" not in ARCHITECTURES and "HRR" in list(ARCHITECTURES)
class Mine(MAP):
    pass
ARCHITECTURES.register("Mine", Mine)
"""
HALF = """
from torchvsa import ARCHITECTURES, MAP
class Half(MAP):
    pass
ARCHITECTURES.register("Half", Half)
import there_is_no_such_module
"""
TWICE = """
from torchvsa import ARCHITECTURES, HRR
class Other(HRR):
    pass
ARCHITECTURES.register("HRR", Other)
"""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    modules = {"sound": SOUND, "half": HALF, "twice": TWICE, "leaves": "raise SystemExit('bye')"}
    plugins = {"sound": "sound", "half": "half", "twice": "twice", "leaves": "leaves", "attribute": "sound:Mine"}
    install(tmp_path, "robot-parts", modules, plugins)
    install(tmp_path, "robot-nothing", {}, {"gone": "not_installed"})
    return tmp_path


def test_registries_import_plugins_once_and_tell_what_failed(site: Path) -> None:
    ran = python(
        site,
        """
import sys, warnings
import torchvsa, behaviours
from torchvsa import plugins
assert torchvsa.architecture("HRR", 8).name == "HRR"
assert not {"sound", "half", "twice", "leaves"} & set(sys.modules), "imported before anything asked for them"
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    assert torchvsa.ARCHITECTURES.find("Mine").__module__ == "sound"
    assert "Mine" in torchvsa.ARCHITECTURES
    plugins.load()
said = sorted(str(warning.message) for warning in caught)
assert {warning.category for warning in caught} == {plugins.PluginWarning}
expected = [
    "attribute = 'sound:Mine' of the package 'robot-parts' cannot be imported: ValueError: an entry point of",
    "gone = 'not_installed' of the package 'robot-nothing' cannot be imported: ModuleNotFoundError: No module named",
    "half = 'half' of the package 'robot-parts' cannot be imported: ModuleNotFoundError: No module named 'there_is_no",
    "leaves = 'leaves' of the package 'robot-parts' cannot be imported: SystemExit: bye",
    "twice = 'twice' of the package 'robot-parts' cannot be imported: ValueError: there is another architecture 'HRR' "
    "already: torchvsa.architectures.hrr.HRR; twice.Other needs another name",
]
assert len(said) == len(expected), said
for message, start in zip(said, expected):
    assert message.startswith("the plugin " + start), (message, start)
assert sorted(plugins.failures()) == said
assert torchvsa.architecture("HRR", 8).__class__.__module__ == "torchvsa.architectures.hrr"
try:
    torchvsa.architecture("Missing", 8)
except ValueError as error:
    assert "there is no architecture 'Missing'; choose one of MAP-C" in str(error), error
    assert "'gone'" in str(error) or "gone = 'not_installed'" in str(error), error
else:
    raise SystemExit("not refused")
""",
    )
    assert (ran.returncode, ran.stdout) == (0, "sound is imported\n"), ran.stderr


def test_a_listing_imports_them_too(site: Path) -> None:
    code = """
import torchvsa
from torchvsa.encoders import VALUE_ENCODERS
len(VALUE_ENCODERS)
print(repr(torchvsa.ARCHITECTURES))
"""
    ran = python(site, code, "-W", "ignore")
    assert ran.returncode == 0, ran.stderr
    assert "'Mine'" in ran.stdout


def test_threads_that_need_them_at_once_all_find_them(tmp_path: Path) -> None:
    slow = "import time\ntime.sleep(0.3)\n" + SOUND
    # Two plugins that import each other, in whatever order threads come.
    modules = {"slow": slow, "first": "import second, slow", "second": "import slow, first"}
    install(tmp_path, "robot-slow", modules, {name: name for name in ("second", "first", "slow")})
    ran = python(
        tmp_path,
        """
import threading, torchvsa
from torchvsa.encoders import ENCODERS
from torchvsa.registry import Registry
def ask():
    found.append(torchvsa.ARCHITECTURES.find("Mine"))
found = []
threads = [threading.Thread(target=ask) for _ in range(6)]
[thread.start() for thread in threads]
[thread.join(20) for thread in threads]
assert len(found) == 6 and len(set(found)) == 1, found
""",
        "-W",
        "error",
    )
    assert (ran.returncode, ran.stdout) == (0, "sound is imported\n"), ran.stderr
