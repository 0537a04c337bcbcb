"""Rules and policies by name: one from outside joins by `register`."""

import pytest

from behaviours import POLICIES, RULES, OneShot, Priority
from torchvsa.registry import Registry


@pytest.mark.parametrize(
    ("registry", "kind", "names"),
    [
        (RULES, "learning rule", ["one_shot", "error_driven", "least_squares", "gradient"]),
        (POLICIES, "policy", ["bundle", "priority"]),
    ],
)
def test_names_and_the_error_that_lists_them(registry: Registry[object], kind: str, names: list[str]) -> None:
    assert list(registry)[: len(names)] == names
    with pytest.raises(ValueError, match=f"there is no {kind} 'guess'; choose one of {', '.join(names)}"):
        registry.find("guess")


def test_a_name_that_is_taken_is_refused() -> None:
    class Mine(Priority):
        pass

    taken = r"another policy 'priority' already: behaviours.composition.priority.Priority; .*Mine needs another name"
    with pytest.raises(ValueError, match=taken):
        POLICIES.register("priority", Mine)
    assert POLICIES.find("priority") is Priority


def test_a_rule_that_joins_is_found() -> None:
    class Mine(OneShot):
        name = "mine"

    rules = Registry(RULES.kind, dict(RULES))
    rules.register(Mine.name, Mine)
    assert rules.find("mine") is Mine
    assert "mine" not in RULES
