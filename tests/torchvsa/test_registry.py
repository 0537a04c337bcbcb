"""Registries: parts by name, and errors that list the names there are."""

import pytest

import torchvsa
from torchvsa import ARCHITECTURES, PROTECTIONS, protection
from torchvsa.encoders import ENCODERS, VALUE_ENCODERS, Level, Lookup, encoder, value_encoder
from torchvsa.registry import Registry

ALL = [ARCHITECTURES, PROTECTIONS, ENCODERS, VALUE_ENCODERS]
VSA = torchvsa.MAP(16)
FREE = object()


@pytest.mark.parametrize("registry", ALL, ids=lambda registry: registry.kind)
@pytest.mark.parametrize("name", ["nothing", "", None, 3, ["level"]])
def test_an_unknown_name_lists_the_choices(registry: Registry[object], name: object) -> None:
    with pytest.raises(ValueError, match=f"there is no {registry.kind} ") as refused:
        registry.find(name)
    assert repr(name) in str(refused.value)
    assert all(choice in str(refused.value) for choice in registry)


def test_configs_with_unknown_names_list_the_choices() -> None:
    for make, choice in ((encoder, "subset_product"), (value_encoder, "level"), (protection, "self_shift")):
        for config in ({"name": "x"}, {}):
            with pytest.raises(ValueError, match=choice):
                make(config, VSA)


def test_a_name_is_given_once() -> None:
    registry: Registry[object] = Registry("part", {"one": 1})
    registry.register("two", FREE)
    with pytest.raises(ValueError, match="there is another part 'one' already: 1"):
        registry.register("one", 2)
    registry.register("two", FREE)  # the same part again, as when a module is imported twice
    assert dict(registry) == {"one": 1, "two": FREE}
    assert len(registry) == 2
    assert "two" in registry
    assert registry["one"] == registry.find("one") == 1
    assert repr(registry) == "Registry('part', ['one', 'two'])"
    with pytest.raises(KeyError):
        registry["three"]


def test_an_error_names_both_parts_of_one_name() -> None:
    registry: Registry[object] = Registry("value encoder", {"level": Level})
    with pytest.raises(
        ValueError,
        match=r"another value encoder 'level' already: torchvsa.encoders.level.Level; "
        r"torchvsa.encoders.lookup.Lookup needs another name",
    ):
        registry.register("level", Lookup)
    assert registry.find("level") is Level


def test_a_module_may_be_loaded_again() -> None:
    """Its classes are others then, of the same module and name; of classes made in functions nobody knows."""
    first, again = (
        type("Mine", (Level,), {"__module__": "mine", "__qualname__": "Mine", "name": "mine"}) for _ in range(2)
    )
    registry: Registry[object] = Registry("value encoder", {"mine": first})
    registry.register("mine", again)
    assert registry.find("mine") is again
    local, other = (type("Mine", (), {"__module__": "mine", "__qualname__": "make.<locals>.Mine"}) for _ in "ab")
    registry.register("local", local)
    with pytest.raises(ValueError, match="another value encoder 'local' already"):
        registry.register("local", other)


def test_a_part_is_found_by_the_name_that_its_files_hold() -> None:
    registry: Registry[object] = Registry("value encoder")
    with pytest.raises(ValueError, match="Level has the name 'level'; it cannot be registered as 'mine'"):
        registry.register("mine", Level)
    assert "mine" not in registry


@pytest.mark.parametrize("name", ["", None, 3])
def test_a_name_is_a_text(name: str) -> None:
    with pytest.raises(ValueError, match="the name of a part is a text that is not empty"):
        Registry("part").register(name, 1)


def test_what_joins_is_found_by_name() -> None:
    class Mine(Level):
        name = "mine"

    registry = Registry("value encoder", dict(VALUE_ENCODERS))
    registry.register(Mine.name, Mine)
    assert registry.find("mine") is Mine
    assert "mine" not in VALUE_ENCODERS
