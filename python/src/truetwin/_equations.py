"""Equations as text: the tables of a twin as a study file has them, from strings and sympy expressions."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any, Union

import numpy as np

from ._numbers import mapping, named, number, shown, text
from ._simulator import Parameter, Range, ranged

#: An expression: a text such as ``"-k*h + u"``, a number, or an expression of sympy.
Expression = Any
#: An entry of a table: an expression, or its keys.
Entry = Union[Expression, Mapping[str, Any]]


def _is_sympy(value: Any) -> bool:
    return hasattr(value, "free_symbols") and hasattr(value, "atoms")


def is_expression(value: Any) -> bool:
    """Tell whether a level of noise is no number: a text or an expression of sympy, or keys with these."""
    return isinstance(value, (str, Mapping)) or _is_sympy(value)


def expression(what: str, value: Expression) -> str | float:
    """Return an expression as a file has it; `what` names it in a message.

    Raises
    ------
    TypeError
        No text, number or expression of sympy; or a function of sympy that the program does not know.
    """
    if isinstance(value, str):
        return text(what, value).replace("**", "^")
    if _is_sympy(value):
        return _sympy(what, value)
    try:
        return number(what, value, "")
    except ValueError:
        raise TypeError(f"{what} = {shown(value)}; give a text, a number or an expression of sympy") from None


#: Names of the program for functions of sympy.
_NAMES = {
    "Abs": "abs", "log": "ln", "sqrt": "sqrt", "exp": "exp", "sign": "sign", "floor": "floor", "Min": "min", "Max": "max", "Mod": "mod",
    "sin": "sin", "cos": "cos", "tan": "tan", "asin": "asin", "acos": "acos", "atan": "atan", "atan2": "atan2",
    "sinh": "sinh", "cosh": "cosh", "tanh": "tanh",
}  # fmt: skip
_RELATIONS = {"Eq": "==", "Ne": "!=", "Lt": "<", "Le": "<=", "Gt": ">", "Ge": ">="}


def _sympy(what: str, value: Any) -> str:
    """Return an expression of sympy in the language of the program; brackets wherever they may matter. `what` names it in a message."""
    import sympy  # type: ignore[import-not-found, import-untyped, unused-ignore]

    def unknown(e: Any) -> TypeError:
        names = ", ".join(sorted(set(_NAMES.values())))
        return TypeError(f"{what}: {type(e).__name__} of sympy is unknown to the program; write it with {names}")

    def written(e: Any) -> str:
        if not isinstance(e, (sympy.Expr, sympy.logic.boolalg.Boolean)) or isinstance(e, (sympy.Derivative, sympy.Integral, sympy.Sum, sympy.Product)):
            raise unknown(e)
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
            branches = "0"
            for branch, condition in reversed(e.args):
                branches = f"if({written(condition)}, {written(branch)}, {branches})"
            return branches
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
        if e.is_Function and len(e.args) == 1 and str(e.args[0]) == "t" and type(e).__name__ not in _NAMES:
            # q(t), as dynamics are often written.
            return type(e).__name__
        name = _NAMES.get(type(e).__name__)
        if name is None:
            raise unknown(e)
        return f"{name}({', '.join(arguments)})"

    return written(value)


def _key(name: str) -> str:
    """Return a key of a TOML file."""
    return name if re.fullmatch("[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)


def _value(what: str, value: Any) -> str:
    """Return a value of a TOML file; `what` names it in a message."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # The escapes of JSON are some of TOML's.
        return json.dumps(text(what, value), ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_value(f'{what}, {key}', inner)}" for key, inner in named(what, value, "keys").items()) + " }"
    if isinstance(value, Sequence) or isinstance(value, np.ndarray) and value.ndim:
        return "[" + ", ".join(_value(what, inner) for inner in value) + "]"
    real = number(what, value, "give a number or a text")
    return str(int(real)) if isinstance(value, (int, np.integer)) else repr(real)


def _keys(name: str, entry: Mapping[str, Any], expressions: Sequence[str]) -> dict[str, Any]:
    """Return the keys of the entry `name`, expressions of sympy as texts."""
    keys: dict[str, Any] = {}
    for key, value in named(name, entry, "keys").items():
        if key in expressions and not isinstance(value, Mapping):
            what = f"{name}, {key}"
            keys[key] = _ends(what, value) if key == "limits" else expression(what, value)
        elif isinstance(value, Mapping):
            keys[key] = _keys(f"{name}, {key}", value, ("mean", "std", "value"))
        else:
            keys[key] = value
    return keys


def _ends(what: str, value: Any) -> list[str | float]:
    if isinstance(value, str) or not isinstance(value, (Sequence, np.ndarray)):
        raise TypeError(f"{what} = {shown(value)}; give (low, high)")
    return [expression(what, end) for end in value]


def _parameter(name: str, value: Parameter | Range | Mapping[str, Any]) -> dict[str, Any]:
    if isinstance(value, Mapping):
        return dict(value)
    parameter = ranged(name, value)
    keys: dict[str, Any] = {"unit": parameter.unit} if parameter.unit else {}
    keys["prior"] = list(parameter.prior)
    if parameter.bounds is not None:
        keys["bounds"] = list(parameter.bounds)
    return keys


def tables(entries: Mapping[str, Entry], key: str) -> dict[str, dict[str, Any]]:
    """Return the entries of states or outputs as tables of keys; `key` is that of an entry that is an expression alone."""
    whole = {text("a name", name): entry if isinstance(entry, Mapping) else {key: entry} for name, entry in entries.items()}
    return {name: _keys(name, entry, (key, "next", "start", "noise", "limits")) for name, entry in whole.items()}


def _table(name: str, entries: Mapping[str, Any]) -> str:
    if not entries:
        return ""
    return f"[{name}]\n" + "".join(f"{_key(key)} = {_value(key, value)}\n" for key, value in entries.items()) + "\n"


def _event(event: Mapping[str, Any]) -> str:
    """Return an event as a file has it."""
    keys: dict[str, Any] = {}
    for key, value in mapping("events: an entry", event, "when or at, and set or add").items():
        if isinstance(value, Mapping):
            keys[key] = {state: expression(f"events: {key}, {state}", inner) for state, inner in value.items()}
        elif isinstance(value, (Sequence, np.ndarray)) and not isinstance(value, str) and np.ndim(value):
            keys[key] = [expression(f"events: {key}", inner) for inner in value]
        else:
            keys[key] = expression(f"events: {key}", value)
    return "[[event]]\n" + "".join(f"{key} = {_value(key, value)}\n" for key, value in keys.items()) + "\n"


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
        self.name = text("name", name)
        self.inputs = list(inputs)
        self.outputs = list(outputs)
        self.step = record.get("step")
        self.text = (
            _table("twin", {"name": name})
            + _table("parameters", {key: _parameter(key, value) for key, value in parameters.items()})
            + _table("constants", {key: expression(f"constants: {key}", value) for key, value in constants.items()})
            + _table("define", {key: expression(f"define: {key}", value) for key, value in define.items()})
            + _table("states", tables(states, "rate"))
            + _table("inputs", {key: unit if isinstance(unit, Mapping) else {"unit": unit} for key, unit in inputs.items()})
            + _table("outputs", tables(outputs, "value"))
            + "".join(_event(event) for event in events)
            + _table("record", record)
        )
