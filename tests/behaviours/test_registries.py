"""Rules and policies by name: one from outside joins by `register`."""

import pytest

from behaviours import POLICIES, RULES, OneShot, Priority
from behaviours.learning import check_rule
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


def test_what_joins_is_found_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    class Mine(OneShot):
        name = "mine"

    monkeypatch.setattr(RULES, "_parts", dict(RULES))
    RULES.register(Mine.name, Mine)
    assert RULES.find("mine") is Mine
    with pytest.raises(TypeError, match=r"write Mine\(\) for 'mine'"):
        check_rule("mine")
    with pytest.raises(
        ValueError, match=r"another policy 'priority' already: behaviours.composition.priority.Priority"
    ):
        POLICIES.register("priority", Mine)  # type: ignore[arg-type]
    assert POLICIES.find("priority") is Priority
