"""Equations as Python functions over blocks of points: their description, and answers to the program's requests."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Union

import numpy as np

from ._equations import Entry, _parameter, expression, tables
from ._errors import Diverged
from ._numbers import Array, number, reals
from ._simulator import Parameter, Range, _located, _name, units_of

#: ``f(t, x, u, theta)``: arrays of shape (points,), (states, points), (inputs, points) and (parameters, points).
Equation = Callable[[Array, Array, Array, Array], Array]
#: States: names, names with units, or names with the keys of a state.
States = Union[str, Sequence[str], Mapping[str, Entry]]


class PointModel:
    """Functions of the states with their description. Parameters: see `truetwin.Twin`."""

    #: Functions draw no noise: it is declared.
    takes_seed = False

    def __init__(
        self,
        drift: Equation | None,
        observe: Equation | None,
        parameters: Mapping[str, Parameter | Range],
        states: Mapping[str, Entry],
        inputs: str | Sequence[str] | Mapping[str, Any],
        outputs: Mapping[str, Entry],
        constants: Mapping[str, Any],
        define: Mapping[str, Any],
        record: Mapping[str, Any],
        name: str | None,
    ) -> None:
        first = drift or observe
        assert first is not None
        self.name = name or _name(first)
        self.step = record.get("step")
        self.failure: BaseException | None = None
        # In discrete time, drift returns the states at the next sample.
        motion = "next" if record.get("integrator") == "discrete" else "drift"
        described = {
            "states": tables(_open(states) if drift else states, "rate"),
            "outputs": tables(_open(outputs) if observe else outputs, "value"),
        }
        self.states, self.outputs = list(described["states"]), list(described["outputs"])
        units = inputs if isinstance(inputs, Mapping) else units_of("inputs", inputs)
        self.inputs = list(units)
        self._functions: dict[str, tuple[Equation, list[str]]] = {}
        if drift:
            self._functions[motion] = (drift, self.states)
        if observe:
            self._functions["observe"] = (observe, self.outputs)
        self._parameters = len(parameters)
        description = {
            "name": self.name,
            "serves": list(self._functions),
            "parameters": {key: _parameter(key, value) for key, value in parameters.items()},
            "constants": {key: expression(f"constants: {key}", value) for key, value in constants.items()},
            "define": {key: expression(f"define: {key}", value) for key, value in define.items()},
            "inputs": {key: unit if isinstance(unit, Mapping) else {"unit": unit} for key, unit in units.items()},
            **described,
            "record": {key: value for key, value in record.items() if (key, value) != ("integrator", "discrete")},
        }
        # Here and not in a thread of the server, where a wrong value would be no error of the call.
        self.description = json.dumps(_json("description", description)).encode() + b"\n"

    def answer(self, line: bytes, read: Callable[[int], bytes]) -> bytes:
        """Return the answer to one request; `read` returns the bytes behind its line."""
        request = json.loads(line)
        if request["request"] == "describe":
            return self.description
        function, names = self._functions[request["request"]]
        points = request["points"]
        table = np.frombuffer(read(request["bytes"]), "<f8").reshape(-1, points)
        inputs, parameters = len(self.inputs), self._parameters
        rows = [1 + inputs, 1 + inputs + parameters]

        def values_at(table: Array) -> Array:
            u, theta, x = table[1 : rows[0]], table[rows[0] : rows[1]], table[rows[1] :]
            return _checked(_title(function), function(table[0], x, u, theta), names, table.shape[1])

        try:
            # Beyond the finite numbers, the program tries other parameters.
            with np.errstate(all="ignore"):
                try:
                    values = values_at(table)
                except _BEYOND:
                    # Points of several searches stand side by side: one that diverges takes no other along.
                    values = np.hstack([_or_nan(values_at, table[:, [point]], len(names)) for point in range(points)])
        except BaseException as error:  # SystemExit in a thread would leave the program without an answer.
            if self.failure is None:
                self.failure = error
            return f'{{"id":{request["id"]},"error":{json.dumps(_located(error, function))}}}\n'.encode()
        numbers = values.astype("<f8", order="C", copy=False).tobytes()
        return f'{{"id":{request["id"]},"bytes":{len(numbers)}}}\n'.encode() + numbers


#: What a function raises where its numbers are not finite.
_BEYOND = (Diverged, OverflowError, FloatingPointError)


def _or_nan(values_at: Callable[[Array], Array], point: Array, count: int) -> Array:
    """Return the values at one point; not a number where it has none."""
    try:
        return values_at(point)
    except _BEYOND:
        return np.full((count, 1), np.nan)


def _title(function: Equation) -> str:
    return str(getattr(function, "__name__", type(function).__name__))


def _checked(title: str, values: Any, names: Sequence[str], points: int) -> Array:
    """Return the values of a function; nan where they are masked, which is a divergence there.

    Raises
    ------
    TypeError, ValueError
        No array of real numbers, or one of another shape; the message names the function and both shapes.
    """
    expected = f"return an array of shape ({len(names)}, {points}): {', '.join(names)} by points"
    if not isinstance(values, np.ndarray):
        what = "None" if values is None else f"a {type(values).__name__}"
        raise TypeError(f"{title} returned {what}; {expected}, such as np.array([...])")
    if len(names) == 1 and values.shape == (points,):
        values = values.reshape(1, points)
    if values.shape != (len(names), points):
        raise ValueError(f"{title} returned shape {values.shape}; {expected}")
    if values.dtype.kind not in "fiub":
        raise TypeError(f"{title} returned an array of {values.dtype}; {expected}, of real numbers")
    return reals(values, expected)


def _open(entries: Mapping[str, Entry]) -> dict[str, Entry]:
    """Return the entries of states or outputs that a function computes: texts are units."""
    return {key: entry if isinstance(entry, Mapping) else {"unit": str(entry)} for key, entry in entries.items()}


def _json(what: str, value: Any) -> Any:
    """Return a description as JSON has it: its infinities, which JSON has not, are null, as an open end of limits is."""
    if value is None or isinstance(value, (str, bool)):
        return value
    if isinstance(value, Mapping):
        return {str(key): _json(str(key), inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_json(what, inner) for inner in value]
    if isinstance(value, (int, np.integer)):
        return int(value)
    real = number(what, value, "give a number or a text")
    return real if np.isfinite(real) else None
