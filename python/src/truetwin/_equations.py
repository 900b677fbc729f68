"""Equations as text: the tables of a twin as a study file has them, from strings and sympy expressions."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, Union

from ._simulator import Parameter, Range

#: An expression: a text such as ``"-k*h + u"``, a number, or an expression of sympy.
Expression = Any
#: An entry of a table: an expression, or its keys.
Entry = Union[Expression, Mapping[str, Any]]


def _is_sympy(value: Any) -> bool:
    return hasattr(value, "free_symbols") and hasattr(value, "atoms")


def expression(value: Expression) -> str | float:
    """Return an expression as a file has it.

    Raises
    ------
    TypeError
        No text, number or expression of sympy; or a function of sympy that the program does not know.
    """
    if isinstance(value, str):
        return value.replace("**", "^")
    if _is_sympy(value):
        return _sympy(value)
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    try:
        return float(value)
    except (TypeError, ValueError):
        raise TypeError(f"expression of type {type(value).__name__}; give a text, a number or an expression of sympy") from None


#: Names of the program for functions of sympy.
_NAMES = {
    "Abs": "abs", "log": "ln", "sqrt": "sqrt", "exp": "exp", "sign": "sign", "floor": "floor", "Min": "min", "Max": "max", "Mod": "mod",
    "sin": "sin", "cos": "cos", "tan": "tan", "asin": "asin", "acos": "acos", "atan": "atan", "atan2": "atan2",
    "sinh": "sinh", "cosh": "cosh", "tanh": "tanh",
}  # fmt: skip
_RELATIONS = {"Eq": "==", "Ne": "!=", "Lt": "<", "Le": "<=", "Gt": ">", "Ge": ">="}


def _sympy(value: Any) -> str:
    """Return an expression of sympy in the language of the program; brackets wherever they may matter."""
    import sympy  # type: ignore[import-not-found, import-untyped, unused-ignore]

    def written(e: Any) -> str:
        if e.is_Symbol:
            return str(e.name)
        if e.is_Integer:
            return str(e) if e >= 0 else f"({e})"
        if e.is_Rational:
            return f"({e.p}/{e.q})"
        if e.is_Float:
            return f"({float(e)!r})" if e < 0 else repr(float(e))
        if e is sympy.pi:
            return "pi"
        if e.is_NumberSymbol or e is sympy.E:
            return repr(float(e))
        if e is sympy.true or e is sympy.false:
            return "1" if e is sympy.true else "0"
        if isinstance(e, sympy.Piecewise):
            text = "0"
            for branch, condition in reversed(e.args):
                text = f"if({written(condition)}, {written(branch)}, {text})"
            return text
        arguments = [written(argument) for argument in e.args]
        if e.is_Add:
            return "(" + " + ".join(arguments) + ")"
        if e.is_Mul:
            return "(" + "*".join(arguments) + ")"
        if e.is_Pow:
            if e.exp == sympy.Rational(1, 2):
                return f"sqrt({arguments[0]})"
            return f"({arguments[0]}^{arguments[1]})"
        if isinstance(e, sympy.exp):
            return f"exp({arguments[0]})"
        if isinstance(e, sympy.Not):
            return f"(not {arguments[0]})"
        if isinstance(e, (sympy.And, sympy.Or)):
            word = " and " if isinstance(e, sympy.And) else " or "
            return "(" + word.join(arguments) + ")"
        relation = next((sign for name, sign in _RELATIONS.items() if isinstance(e, getattr(sympy, name))), None)
        if relation:
            return f"({arguments[0]} {relation} {arguments[1]})"
        if e.is_Function and not e.args[1:] and str(e.args[0]) == "t" and type(e).__name__ not in _NAMES:
            # q(t), as dynamics are often written.
            return type(e).__name__
        name = _NAMES.get(type(e).__name__)
        if name is None:
            raise TypeError(f"{type(e).__name__} of sympy is unknown to the program; write it with {', '.join(sorted(set(_NAMES.values())))}")
        return f"{name}({', '.join(arguments)})"

    return written(value)


def _value(value: Any) -> str:
    """Return a value of a TOML file."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # The escapes of JSON are some of TOML's.
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, Sequence):
        return "[" + ", ".join(_value(inner) for inner in value) + "]"
    number = float(value)
    text = repr(number)
    return str(int(number)) if isinstance(value, int) else text


def _keys(entry: Mapping[str, Any], expressions: Sequence[str]) -> dict[str, Any]:
    """Return the keys of an entry, expressions of sympy as texts."""
    keys: dict[str, Any] = {}
    for key, value in entry.items():
        if key in expressions and not isinstance(value, Mapping):
            keys[key] = [expression(end) for end in value] if key == "limits" else expression(value)
        elif isinstance(value, Mapping):
            keys[key] = _keys(value, ("mean", "std", "value"))
        else:
            keys[key] = value
    return keys


def _parameter(value: Parameter | Range | Mapping[str, Any]) -> dict[str, Any]:
    if isinstance(value, Parameter):
        keys: dict[str, Any] = {"unit": value.unit} if value.unit else {}
        keys["prior"] = [float(end) for end in value.prior]
        if value.bounds is not None:
            keys["bounds"] = [float(end) for end in value.bounds]
        return keys
    if isinstance(value, Mapping):
        return dict(value)
    return {"prior": [float(end) for end in value]}


def tables(entries: Mapping[str, Entry], key: str) -> dict[str, dict[str, Any]]:
    """Return the entries of states or outputs as tables of keys; `key` is that of an entry that is an expression alone."""
    whole = {name: entry if isinstance(entry, Mapping) else {key: entry} for name, entry in entries.items()}
    return {name: _keys(entry, (key, "next", "start", "noise", "limits")) for name, entry in whole.items()}


def _table(name: str, entries: Mapping[str, Any]) -> str:
    if not entries:
        return ""
    return f"[{name}]\n" + "".join(f"{key} = {_value(value)}\n" for key, value in entries.items()) + "\n"


def _event(event: Mapping[str, Any]) -> str:
    """Return an event as a file has it."""
    keys: dict[str, Any] = {}
    for key, value in event.items():
        if isinstance(value, Mapping):
            keys[key] = {state: expression(inner) for state, inner in value.items()}
        elif isinstance(value, Sequence) and not isinstance(value, str):
            keys[key] = [expression(inner) for inner in value]
        else:
            keys[key] = expression(value)
    return "[[event]]\n" + "".join(f"{key} = {_value(value)}\n" for key, value in keys.items()) + "\n"


class Text:
    """A twin as text.

    Parameters
    ----------
    See `truetwin.Twin`.
    """

    def __init__(
        self,
        name: str,
        parameters: Mapping[str, Any],
        states: Mapping[str, Entry],
        inputs: Mapping[str, Any],
        outputs: Mapping[str, Entry],
        constants: Mapping[str, Expression],
        define: Mapping[str, Expression],
        events: Sequence[Mapping[str, Any]],
        record: Mapping[str, Any],
    ) -> None:
        self.name = name
        self.inputs = list(inputs)
        self.outputs = list(outputs)
        self.step = record.get("step")
        self.text = (
            _table("twin", {"name": name})
            + _table("parameters", {key: _parameter(value) for key, value in parameters.items()})
            + _table("constants", {key: expression(value) for key, value in constants.items()})
            + _table("define", {key: expression(value) for key, value in define.items()})
            + _table("states", tables(states, "rate"))
            + _table("inputs", {key: unit if isinstance(unit, Mapping) else {"unit": unit} for key, unit in inputs.items()})
            + _table("outputs", tables(outputs, "value"))
            + "".join(_event(event) for event in events)
            + _table("record", record)
        )
