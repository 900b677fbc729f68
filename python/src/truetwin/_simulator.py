"""A Python callable as a simulator of the program: its description, and answers to requests for simulations."""

from __future__ import annotations

import inspect
import json
import os
import re
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from ._errors import Diverged

Array = npt.NDArray[np.float64]
#: What a simulator may return: one output, a tuple or the columns of an array for several, or outputs by name.
Outputs = Union[npt.ArrayLike, Mapping[str, npt.ArrayLike]]
#: ``f(parameters, inputs, time)``; with arguments named ``step`` or ``seed``, it gets these too.
Simulator = Callable[..., Outputs]
Range = tuple[float, float]
#: Inputs of simulated records: one range for all, or by input a range, ``{"levels": (low, high), "hold": n}``, a number, or a CSV file.
Levels = Union[Range, Mapping[str, Union[Range, float, str, "os.PathLike[str]", Mapping[str, Any]]]]

#: Inputs that are kept parsed; a record's inputs come with each request.
KEPT_INPUTS = 64


@dataclass(frozen=True)
class Parameter:
    """A parameter of a simulator.

    Parameters
    ----------
    prior : (float, float)
        Range of plausible values; training simulations are drawn from it.
    bounds : (float, float), optional
        Range of physically possible values. The default is the prior.
    unit : str, optional
        Unit for reports.
    """

    prior: Range
    bounds: Range | None = None
    unit: str = ""


class Model:
    """A callable with its description."""

    def __init__(
        self,
        simulator: Simulator,
        parameters: Mapping[str, Parameter | Range],
        inputs: str | Sequence[str] | Mapping[str, str],
        outputs: str | Sequence[str] | Mapping[str, str],
        step: float,
        samples: int,
        levels: Levels | None,
        hold: int,
        name: str | None,
    ) -> None:
        self.simulator = simulator
        self.inputs = _units(inputs)
        self.outputs = _units(outputs)
        self.parameters = {key: _parameter(key, value) for key, value in parameters.items()}
        self.step = float(step)
        self.name = name or _name(simulator)
        self.failure: BaseException | None = None
        self._takes_step = _takes(simulator, "step")
        self.takes_seed = _takes(simulator, "seed")
        self._kept: dict[bytes, dict[str, Array]] = {}
        self._times: dict[tuple[float, int, float], Array] = {}
        record: dict[str, Any] = {"step": self.step, "samples": whole("samples", samples)}
        if levels is not None:
            record["input"] = planned(levels, hold)
            if files := [name for name, plan in record["input"].items() if isinstance(plan, str)]:
                raise ValueError(f"levels: {files[0]} is a file; name files in a study file, [record] input: study=FILE")
        self.description = {
            "name": self.name,
            "parameters": [_described(key, value) for key, value in self.parameters.items()],
            "inputs": [{"name": key, "unit": unit} for key, unit in self.inputs.items()],
            "outputs": [{"name": key, "unit": unit} for key, unit in self.outputs.items()],
            "record": record,
        }

    def answer(self, line: bytes, read: Callable[[int], bytes]) -> bytes:
        """Return the answer to one request, both as lines of JSON; no bytes are behind them."""
        head, inputs, seed = _split(line)
        request = json.loads(head)
        if request.get("request") == "describe":
            return json.dumps(self.description).encode() + b"\n"
        try:
            step, samples = request["step"], request["samples"]
            start = request.get("start", 0.0)
            keywords: dict[str, Any] = {}
            if self._takes_step:
                keywords["step"] = step
            if self.takes_seed:
                keywords["seed"] = json.loads(seed)
            result = self.simulator(request["theta"], self._inputs(inputs), self._time(step, samples, start), **keywords)
            outputs = ",".join(f"{json.dumps(key)}:[{_numbers(column)}]" for key, column in self._columns(result, samples))
            answer = f'"outputs":{{{outputs}}}'
        except Diverged as error:
            answer = f'"diverged":{max(error.time - start, 0.0)!r}'
        except (OverflowError, FloatingPointError):
            # Arithmetic beyond the finite numbers, which arrays show as inf: at these parameters, not in the code.
            answer = '"diverged":0'
        except BaseException as error:  # SystemExit in a thread would leave the program without an answer.
            if self.failure is None:
                self.failure = error
            answer = f'"error":{json.dumps(_located(error, self.simulator))}'
        return f'{{"id":{request["id"]},{answer}}}\n'.encode()

    def _time(self, step: float, samples: int, start: float) -> Array:
        key = (step, samples, start)
        if key not in self._times:
            self._times = {key: _frozen(start + np.arange(samples, dtype=float) * step)}
        return self._times[key]

    def _inputs(self, text: bytes) -> dict[str, Array]:
        arrays = self._kept.get(text)
        if arrays is None:
            arrays = {key: _frozen(np.array(values, dtype=float)) for key, values in json.loads(text).items()}
            if len(self._kept) >= KEPT_INPUTS:
                self._kept = {}
            self._kept[text] = arrays
        return dict(arrays)

    def _columns(self, result: Any, samples: int) -> Iterable[tuple[str, Array]]:
        """Return the outputs by name.

        Raises
        ------
        ValueError
            Not one number per sample for each output.
        """
        names = list(self.outputs)
        if result is None:
            raise ValueError("the simulator returned None; end it with `return` and its outputs")
        if isinstance(result, Mapping):
            if set(result) != set(names):
                raise ValueError(f"the simulator returned the outputs {_list(result)}; return {_list(names)}")
            columns = [_reals(result[key]) for key in names]
        elif isinstance(result, tuple) and len(result) == len(names):
            columns = [_reals(column) for column in result]
        else:
            table = _reals(result)
            if table.ndim == 2 and table.shape[1] == len(names):
                columns = list(table.T)
            elif len(names) == 1:
                columns = [table]
            else:
                raise ValueError(
                    f"the simulator returned an array of shape {table.shape}; return shape ({samples}, {len(names)}), "
                    f"or a dict with {_list(names)}"
                )
        for key, column in zip(names, columns):
            if column.shape != (samples,):
                raise ValueError(
                    f"the simulator returned shape {column.shape} for the output {key}; return shape ({samples},), one value for each time"
                )
        return zip(names, columns)


def _split(line: bytes) -> tuple[bytes, bytes, bytes]:
    """Split a request into its small part, its inputs and its seed: inputs repeat, and need no second parsing."""
    head, mark, rest = line.partition(b',"inputs":')
    inputs, second, seed = rest.rpartition(b',"seed":')
    if mark and second:
        return head + b"}", inputs, seed.rstrip()[:-1]
    request = json.loads(line)
    return line, json.dumps(request.get("inputs", {})).encode(), json.dumps(request.get("seed")).encode()


def _numbers(values: Array) -> str:
    """Return numbers with all their digits; nan and inf are known to the program."""
    # A third faster than json.dumps, and most of the time between two runs.
    return ",".join(["%.17g"] * values.size) % tuple(values.tolist())


def _reals(values: Any) -> Array:
    """Return outputs as floats, nan where they are masked."""
    if np.iscomplexobj(values):
        raise ValueError("the simulator returned complex values; return real ones, such as their real parts or magnitudes")
    if isinstance(values, np.ma.MaskedArray):
        return np.asarray(np.ma.filled(values.astype(float), np.nan))
    return np.asarray(values, dtype=float)


def whole(name: str, value: int) -> int:
    """Return a number of samples; refuse one that is not whole, or below 1."""
    if value != int(value) or value < 1:
        raise ValueError(f"{name} = {value}; give a whole number of samples, at least 1")
    return int(value)


def check_noise(level: object) -> None:
    """Refuse a noise level that is negative or no finite number; expressions are checked by the program."""
    if isinstance(level, (int, float, np.number)) and not 0 <= level < np.inf:
        raise ValueError(f"noise = {level}; give a standard deviation, 0 or more, in the unit of the output")


def _frozen(values: Array) -> Array:
    values.flags.writeable = False
    return values


def _list(names: Iterable[object]) -> str:
    return ", ".join(str(name) for name in names) or "none"


def _units(names: str | Sequence[str] | Mapping[str, str]) -> dict[str, str]:
    if isinstance(names, str):
        return {names: ""}
    if isinstance(names, Mapping):
        return dict(names)
    units = dict.fromkeys(names, "")
    if len(units) != len(names):
        raise ValueError(f"inputs or outputs {_list(names)}: a name appears twice; rename one")
    return units


def planned(levels: Levels, hold: int) -> dict[str, Any]:
    """Return the plan of inputs as ``[record] input`` has it."""
    if not isinstance(levels, Mapping):
        return _staircase("levels", levels, hold)
    plans: dict[str, Any] = {}
    for name, plan in levels.items():
        if isinstance(plan, (str, os.PathLike)):
            plans[name] = os.path.abspath(os.fspath(plan))
        elif isinstance(plan, Mapping):
            if unknown := set(plan) - {"levels", "hold"}:
                raise ValueError(f"levels: {name} has no {sorted(unknown)[0]}; give levels and hold")
            plans[name] = _staircase(f"levels: {name}", plan.get("levels"), plan.get("hold", hold))
        elif np.ndim(plan) == 0 and not isinstance(plan, bool):
            try:
                plans[name] = float(plan)  # type: ignore[arg-type]
            except (TypeError, ValueError):
                raise ValueError(f"levels: {name} = {plan!r}; give (low, high), a number, or the path of a file") from None
        else:
            plans[name] = _staircase(f"levels: {name}", plan, hold)
    return plans


def _staircase(what: str, levels: Any, hold: int) -> dict[str, Any]:
    samples = whole("hold", hold)
    try:
        low, high = levels
        return {"levels": [float(low), float(high)], "hold": samples}
    except (TypeError, ValueError):
        raise ValueError(f"{what} = {levels!r}; give (low, high)") from None


def _parameter(name: str, value: Parameter | Range) -> Parameter:
    if isinstance(value, Parameter):
        return value
    try:
        low, high = value
        return Parameter((float(low), float(high)))
    except (TypeError, ValueError):
        raise ValueError(f"parameters: {name} = {value!r}; give (low, high), or truetwin.Parameter(...)") from None


def _described(name: str, parameter: Parameter) -> dict[str, Any]:
    described: dict[str, Any] = {"name": name, "unit": parameter.unit, "prior": [float(end) for end in parameter.prior]}
    if parameter.bounds is not None:
        described["bounds"] = [float(end) for end in parameter.bounds]
    return described


def _name(simulator: Simulator) -> str:
    name = getattr(simulator, "__name__", type(simulator).__name__)
    return re.sub(r"[^A-Za-z0-9_-]+", "-", name).strip("-") or "simulator"


def _takes(simulator: Simulator, keyword: str) -> bool:
    try:
        parameters = inspect.signature(simulator).parameters.values()
    except (TypeError, ValueError):
        return False
    return any(p.name == keyword and p.kind is not p.POSITIONAL_ONLY for p in parameters)


def _located(error: BaseException, simulator: Simulator) -> str:
    """Return an exception in one line, with the line of the simulator's file where it was raised."""
    frames = list(traceback.extract_tb(error.__traceback__))
    code = getattr(inspect.unwrap(simulator), "__code__", None)
    own = [frame for frame in frames if code is not None and frame.filename == code.co_filename]
    # The first frames are this package's own.
    outside = [frame for frame in frames if os.path.dirname(frame.filename) != os.path.dirname(__file__)]
    text = " ".join(f"{type(error).__name__}: {error}".split())
    for frame in (own or outside)[-1:]:
        return f"{os.path.basename(frame.filename)}, line {frame.lineno}: {text}"
    if code is not None:
        return f"{os.path.basename(code.co_filename)}, line {code.co_firstlineno}: {text}"
    return text
