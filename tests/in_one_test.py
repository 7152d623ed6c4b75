"""Many values of one check as one test."""

import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any

import pytest
from hypothesis import is_hypothesis_test


def over(
    names: str | tuple[str, ...], values: Iterable[Any], ids: Callable[[Any], object] | Iterable[object] = ()
) -> Callable[..., Any]:
    """Decorate a check like ``pytest.mark.parametrize`` does, but as one test.

    For checks that fail for one reason, whatever the value: each value that fails is reported by itself, under its
    name in ``ids``, and the others are checked nevertheless.
    """
    several = isinstance(names, tuple)
    arguments = names if isinstance(names, tuple) else (names,)
    cases = list(values)
    if not cases:
        raise ValueError("a test of no values at all cannot fail")
    labels = [ids(case) for case in cases] if callable(ids) else list(ids)

    def decorate(check: Callable[..., None]) -> Callable[..., None]:
        parameters = inspect.signature(check).parameters
        fixtures = [each for name, each in parameters.items() if name not in (*arguments, "subtests")]
        nested = "subtests" in parameters

        @functools.wraps(check)
        def test(subtests: pytest.Subtests, **others: Any) -> None:
            given = {"subtests": subtests} if nested else {}
            for place, case in enumerate(cases):
                case_values = case if several else (case,)
                shown = (
                    [labels[place]] if labels else [getattr(value, "name", value) for value in case_values]
                )
                with subtests.test(msg=", ".join(map(str, shown))):
                    check(**given, **others, **dict(zip(arguments, case_values, strict=True)))

        # What hypothesis has left on the check is not true of the test around it, but that it has examples.
        test.__dict__ = {name: value for name, value in vars(test).items() if "hypothesis" not in name}
        del test.__wrapped__  # type: ignore[attr-defined]
        reporter = inspect.Parameter("subtests", inspect.Parameter.POSITIONAL_OR_KEYWORD)
        test.__signature__ = inspect.Signature([reporter, *fixtures])  # type: ignore[attr-defined]
        return pytest.mark.hypothesis(test) if is_hypothesis_test(check) else test

    return decorate
