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
from ._names import word
from ._numbers import Array, interval, named, number, one_line, reals, shown, text, whole
from ._records import is_frame

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
        self.inputs = units_of("inputs", inputs)
        self.outputs = units_of("outputs", outputs)
        self.parameters = {key: ranged(key, value) for key, value in parameters.items()}
        self.step = seconds("step", step)
        self.name = name or _name(simulator)
        self.failure: BaseException | None = None
        self._takes_step = _takes(simulator, "step")
        self.takes_seed = _takes(simulator, "seed")
        self._kept: dict[bytes, dict[str, Array]] = {}
        self._times: dict[tuple[float, int, float], Array] = {}
        record: dict[str, Any] = {"step": self.step, "samples": samples}
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
            end = start + (samples - 1) * step
            if error.time <= end:
                answer = f'"diverged":{max(error.time - start, 0.0)!r}'
            else:
                late = f"Diverged({error.time:.6g}): give a time of this run, which ends at {end:.6g} s"
                answer = f'"error":{json.dumps(late)}'
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
        if is_frame(result):
            # Columns without names are numbered.
            given = list(result.columns)
            result = result.to_numpy() if given == list(range(len(given))) else dict(result.items())
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
    try:
        return reals(values, "return numbers, nan where missing")
    except ValueError as error:
        raise ValueError(f"the simulator returned {error}") from None


def seconds(name: str, value: object) -> float:
    """Return a number of seconds; refuse one that is not finite, or not above 0."""
    remedy = "give a number of seconds above 0"
    given = number(name, value, remedy)
    if not 0 < given < np.inf:
        raise ValueError(f"{name} = {shown(value)}; {remedy}")
    return given


def noise_level(output: str, level: object) -> float:
    """Return the noise level of an output; refuse one that is negative or no finite number."""
    remedy = "give a standard deviation, 0 or more, in the unit of the output"
    given = number(f"noise of {output}", level, remedy)
    if not 0 <= given < np.inf:
        raise ValueError(f"noise of {output} = {shown(level)}; {remedy}")
    return given


def _frozen(values: Array) -> Array:
    values.flags.writeable = False
    return values


def _list(names: Iterable[object]) -> str:
    return ", ".join(str(name) for name in names) or "none"


def listed(what: str, names: Any) -> list[str]:
    """Return names, each once; a text is one. Refuse anything else."""
    if isinstance(names, (bytes, bytearray)) or not isinstance(names, Iterable):
        raise TypeError(f"{what} = {shown(names)}; give names, or a dict with a unit for each")
    given = [text(f"{what}: a name", name) for name in ([names] if isinstance(names, str) else names)]
    if twice := [name for at, name in enumerate(given) if name in given[:at]]:
        raise ValueError(f"{what}: {twice[0]} appears twice; rename one")
    return given


def units_of(what: str, names: str | Iterable[str] | Mapping[str, str]) -> dict[str, str]:
    """Return names with their units, which may be missing."""
    if isinstance(names, Mapping):
        return {name: text(f"{what}: {name}, unit", unit or "") for name, unit in named(what, names, "units").items()}
    return dict.fromkeys(listed(what, names), "")


def planned(levels: Levels, hold: int) -> dict[str, Any]:
    """Return the plan of inputs as ``[record] input`` has it."""
    if not isinstance(levels, Mapping):
        return _staircase("levels", levels, hold)
    plans: dict[str, Any] = {}
    for name, plan in named("levels", levels, "plans").items():
        if isinstance(plan, (str, os.PathLike)):
            plans[name] = os.path.abspath(word(plan, f"levels: {name}"))
        elif isinstance(plan, Mapping):
            if unknown := set(plan) - {"levels", "hold"}:
                raise ValueError(f"levels: {name} has no {sorted(unknown)[0]}; give levels and hold")
            if "levels" not in plan:
                raise ValueError(f"levels: {name} has no levels; give {{'levels': (low, high), 'hold': n}}")
            plans[name] = _staircase(f"levels: {name}", plan["levels"], whole(f"levels: {name}, hold", plan.get("hold", hold)))
        elif np.ndim(plan) == 0 and not isinstance(plan, bool):
            remedy = "give (low, high), a number, or the path of a file"
            plans[name] = number(f"levels: {name}", plan, remedy)
            if not np.isfinite(plans[name]):
                raise ValueError(f"levels: {name} = {shown(plan)}; {remedy}")
        else:
            plans[name] = _staircase(f"levels: {name}", plan, hold)
    return plans


def _staircase(what: str, levels: Any, hold: int) -> dict[str, Any]:
    return {"levels": list(interval(what, levels)), "hold": hold}


def ranged(name: str, value: Parameter | Range) -> Parameter:
    """Return a parameter with its ranges as floats."""
    what = f"parameters: {name}"
    if not isinstance(value, Parameter):
        return Parameter(interval(what, value, "give (low, high), or truetwin.Parameter(...)"))
    bounds = None if value.bounds is None else interval(f"{what}, bounds", value.bounds)
    return Parameter(interval(f"{what}, prior", value.prior), bounds, text(f"{what}, unit", value.unit))


def _described(name: str, parameter: Parameter) -> dict[str, Any]:
    described: dict[str, Any] = {"name": name, "unit": parameter.unit, "prior": list(parameter.prior)}
    if parameter.bounds is not None:
        described["bounds"] = list(parameter.bounds)
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
    try:
        said = one_line(f"{type(error).__name__}: {error}")
    except Exception:  # One whose text raises, too.
        said = type(error).__name__
    # A lone half of a pair has no bytes.
    said = said.encode(errors="replace").decode()
    for frame in (own or outside)[-1:]:
        return f"{os.path.basename(frame.filename)}, line {frame.lineno}: {said}"
    if code is not None:
        return f"{os.path.basename(code.co_filename)}, line {code.co_firstlineno}: {said}"
    return said
