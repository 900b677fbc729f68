"""A simulator with its setting, and what can be asked about it."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from . import _process, _records
from ._equations import Entry, Expression, Text, is_expression
from ._errors import TruetwinError
from ._names import Names, word
from ._numbers import Array, count, flag, named, number, one_line, shown, whole
from ._points import Equation, PointModel, States
from ._records import Record, Records
from ._report import Report
from ._results import Check, Diagnosis, Estimate, Estimator, Fit, Json, Scorecard
from ._server import Server
from ._simulator import Levels, Model, Parameter, Range, Simulator, listed, noise_level, planned, seconds, units_of

if TYPE_CHECKING:
    import pandas as pd  # type: ignore[import-untyped, unused-ignore]

Path_ = str | os.PathLike[str]

#: The program's seeds have 64 bits.
LARGEST_SEED = 2**64 - 1


#: Samples of a simulated record, and those for which a random input is held.
SAMPLES, HOLD = 300, 20


class Twin:
    """A simulator with its parameters, inputs and outputs.

    Parameters
    ----------
    simulator : callable, optional
        ``f(parameters, inputs, time)`` returns the outputs at `time`. `parameters` is a dict of floats, `inputs` a dict of
        arrays, and `time` the array 0, step, 2·step, …. Input k acts from sample k to sample k + 1. One output is a sequence of one
        number per sample; several are a tuple, the columns of an array, or a dict. The same call must give the same result.
        A run that is not finite counts as diverged: return nan or a masked value, or raise `Diverged`. Other exceptions end the call.
        If `f` has an argument `step`, it gets the step in seconds. If it has an argument `seed`, it draws its own noise from it,
        and none if it is None; `noise` is much faster. Without a callable, the twin is one that the program knows: give `study`, or
        use `Twin.named`.
    states : dict of str to expression or dict, optional
        Equations in place of a callable, which needs no Python to run: the rate of each state as a text or an expression of sympy, or a dict
        of ``rate`` (or ``next``), ``start``, ``noise``, ``limits`` and ``unit``. `outputs` then is a dict of expressions or of dicts of
        ``value``, ``noise`` and ``unit``. `toml` returns the file.
    drift, observe : callable, optional
        Equations as functions over arrays: ``drift(t, x, u, theta)`` returns the rates of the states, ``observe`` the outputs without
        noise. `x` has shape (states, points), the result too; `u` and `theta` have a row for each input and parameter, `t` is one row: all in
        the order of their declarations, so that ``q, v = x`` names them. Points are computed together, and each by itself. `states`
        then are names, a dict of units, or a dict of dicts as above without ``rate``. Without `observe`, `outputs` is a dict of expressions.
        With ``record={"integrator": "discrete"}``, `drift` returns the states at the next sample.
    constants, define : dict of str to number or expression, optional
        Constants, and names for parts of equations.
    events : sequence of dict, optional
        Changes of states where a condition becomes true, or at times: ``{"when": "h < 0", "set": {"h": 0, "v": "-e*v"}}`` or
        ``{"at": [1.0, 5.5], "add": {"A": "dose"}}``, for equations.
    record : dict, optional
        Further keys of ``[record]``, such as ``{"integrator": "euler"}``, for equations.
    parameters : dict of str to (low, high) or Parameter
        Range of plausible values for each parameter; `Parameter` adds bounds and a unit.
    inputs, outputs : str, sequence of str, or dict of str to unit
        Names in the order of a record's columns; ``inputs=()`` for a simulator without inputs.
    step : float
        Step of simulated records in seconds. Records for `fit` and `diagnose` bring their own.
    noise : float or dict of str to float, optional
        Standard deviation of the measurement noise of each output, for `simulate`, `pretrain`, `check` and `withheld`. `fit` and
        `diagnose` estimate it from the record.
    samples : int, optional
        Number of samples of simulated records, 300 where none is given.
    levels : (low, high), or dict of str to (low, high), dict, float or path, optional
        Inputs of simulated records. A range: each input a staircase of random levels. By input: such a range, or
        ``{"levels": (low, high), "hold": n}``; a constant; or, for equations as texts, the path of a CSV file that has the column.
    hold : int, optional
        Number of samples for which a random input is held, 20 where none is given.
    name : str, optional
        Name in reports and estimators. The default is the name of the callable.
    study : path, optional
        Study file (TOML). With a callable, its ``twin`` is `name`.
    workers : int, optional
        Number of calls of the simulator at once, each in a thread. More than one is faster only if it releases the
        interpreter lock, and then it must be safe to call from several threads.
    threads : int, optional
        Number of threads of the program. The default is all cores.
    timeout : float, optional
        Seconds that one run may take.

    Examples
    --------
    >>> import numpy as np, truetwin
    >>> def decay(parameters, inputs, time):
    ...     return np.exp(-parameters["rate"] * time)
    >>> twin = truetwin.Twin(decay, parameters={"rate": (0.1, 2.0)}, outputs="y", step=0.1)
    >>> record = twin.simulate({"rate": 0.5})
    """

    def __init__(
        self,
        simulator: Simulator | None = None,
        *,
        parameters: Mapping[str, Parameter | Range] | None = None,
        inputs: str | Sequence[str] | Mapping[str, Any] = (),
        outputs: str | Sequence[str] | Mapping[str, Any] | None = None,
        drift: Equation | None = None,
        observe: Equation | None = None,
        states: States | None = None,
        constants: Mapping[str, Expression] | None = None,
        define: Mapping[str, Expression] | None = None,
        events: Sequence[Mapping[str, Any]] = (),
        record: Mapping[str, Any] | None = None,
        step: float | None = None,
        noise: float | Mapping[str, float] | None = None,
        samples: int | None = None,
        levels: Levels | None = None,
        hold: int | None = None,
        name: str | None = None,
        study: Path_ | None = None,
        workers: int = 1,
        threads: int | None = None,
        timeout: float = 60.0,
    ) -> None:
        parameters = named("parameters", parameters, "name: (low, high)")
        constants, define = named("constants", constants, "name: number"), named("define", define, "name: expression")
        record = named("record", record, "keys")
        inputs = () if inputs is None else inputs
        events = () if events is None else events
        if isinstance(events, (Mapping, str)) or not isinstance(events, Sequence):
            raise TypeError(f"events of type {type(events).__name__}; give a list of dicts")
        if not (name is None or isinstance(name, str)):
            raise TypeError(f"name of type {type(name).__name__}; give a text")
        if not (outputs is None or isinstance(outputs, Mapping)):
            outputs = listed("outputs", outputs)
        if not (states is None or isinstance(states, Mapping)):
            states = listed("states", states)
        for given, function in (("drift", drift), ("observe", observe)):
            if not (function is None or callable(function)):
                raise TypeError(f"{given} of type {type(function).__name__}; give a function")
        if twice := [key for key, value in (("step", step), ("samples", samples)) if value is not None and key in record]:
            raise ValueError(f"{twice[0]} is given twice, here and in record; give one")
        if levels is not None and step is None and "step" not in record and study is None:
            raise ValueError("levels are those of simulated records, which need a step; give step=seconds, too")
        self._study = None if study is None else word(study, "study")
        self._threads = None if threads is None else count("threads", threads, 1)
        self._workers = count("workers", workers, 1)
        self._timeout = seconds("timeout", timeout)
        samples = whole("samples", SAMPLES if samples is None else samples)
        hold = whole("hold", HOLD if hold is None else hold)
        self._noise: dict[str, float] = {}
        self._model: Model | PointModel | None = None
        self._text: Text | None = None
        self.name: str | None
        if states is not None:
            if simulator is not None or study is not None:
                raise ValueError("states and a callable or a study; equations stand alone")
            if not parameters or not outputs or not (observe or isinstance(outputs, Mapping)):
                raise ValueError("equations need parameters={name: (low, high)} and outputs={name: expression}")
            if not (drift or isinstance(states, Mapping)):
                raise ValueError("states without rates; give states={name: rate}, or drift=f")
            plan: dict[str, Any] = {} if step is None else {"step": seconds("step", step), "samples": samples}
            if levels is not None:
                plan["input"] = planned(levels, hold)
                files = [of for of, own in plan["input"].items() if isinstance(own, str)]
                if files and (drift or observe):
                    raise ValueError(f"levels: {files[0]} is a file, which equations as texts take; give (low, high) or a number")
            plan |= record
            levels_of_noise = _noise_levels(noise, outputs, list(states), expressions=True)
            moving, shown = _noisy(states, levels_of_noise, "rate", drift), _noisy(outputs, levels_of_noise, "value", observe)
            if drift or observe:
                if events:
                    raise ValueError("events belong to equations as text; give states={name: rate}, and no drift or observe")
                self._model = PointModel(drift, observe, parameters, moving, inputs, shown, constants, define, plan, name)
                self.name = self._model.name
                return
            units = inputs if isinstance(inputs, Mapping) else units_of("inputs", inputs)
            self._text = Text(name or "twin", parameters, moving, units, shown, constants, define, events, plan)
            self.name = self._text.name
            return
        if drift or observe:
            raise ValueError("drift and observe are functions of states; give states=[name]")
        if constants or define or events or record:
            raise ValueError("constants, define, events and record belong to equations; give states={name: rate}")
        if simulator is None:
            if parameters or outputs or noise is not None or inputs or step is not None:
                raise ValueError("parameters, inputs, outputs, step and noise describe a callable; give it, or put them into the study file")
            if (study is None) == (name is None):
                raise ValueError("no simulator; give a callable, study=FILE or Twin.named(NAME)")
            self.name = name
            return
        if not callable(simulator):
            raise TypeError(f"simulator of type {type(simulator).__name__}; give a callable, study=FILE or Twin.named(NAME)")
        if not parameters or not outputs or step is None:
            raise ValueError("a callable needs parameters={name: (low, high)}, outputs=[name] and step=seconds")
        self._model = Model(simulator, parameters, inputs, outputs, step, samples, levels, hold, name)
        self.name = self._model.name
        if noise is not None:
            if study is not None:
                raise ValueError("noise and study; put the noise into the study file, as an [[effect]] with id = \"sensor-noise\"")
            self._noise = _noise_levels(noise, self._model.outputs)

    @classmethod
    def named(cls, name: str, *, threads: int | None = None) -> Twin:
        """Return a reference twin of the program, such as ``"tanks"``; ``truetwin twins`` lists them."""
        return cls(name=name, threads=threads)

    def toml(self) -> str:
        """Return a twin of equations as the text of a study file, which the program takes with ``--study``."""
        if self._text is None:
            raise ValueError("only a twin of equations has a text; give states={name: rate}")
        return self._text.text

    def __repr__(self) -> str:
        return f"Twin({self.name or os.fspath(self._study or '')!r})"

    def fit(
        self,
        records: Records,
        *,
        profile: bool = False,
        columns: Mapping[str, str] | None = None,
        seed: int = 1,
        out: Path_ | None = None,
    ) -> Fit:
        """Fit parameters, noise levels and starts to measured records; no training.

        Parameters
        ----------
        records : record or sequence of records
            A path of a CSV file, a DataFrame, or a dict of arrays, with the columns ``t`` and the names of inputs and outputs. nan
            marks outputs that were not measured. Times are seconds, or datetimes, all with a zone or all without. A record without ``t``,
            and without columns that the twin has not, has the twin's step; beside ``t``, such columns are left out. Messages call the
            first record ``record 1``, and count its rows from 0, as ``.iloc`` does.
        profile : bool, optional
            Profile likelihood of every parameter, as curves and on the page; otherwise of those alone that the prior shapes.
        columns : dict of str to str, optional
            Column of the record for each name in the twin, as in ``{"t": "time", "push": "torque"}``.
        seed : int, optional
            The same seed gives the same result.
        out : path, optional
            New folder that keeps the program's files.

        Returns
        -------
        Fit
        """
        with _Call(self) as call:
            files = call.records(records, columns)
            options = [*call.subject(), *call.columns(columns), *_flags(profile=profile)]
            folder, text = call.folder("fit", [*files, *options], seed, out)
            pictures = sorted(folder.glob("overlay*.svg"), key=lambda path: (len(path.name), path.name))
            report = Report(text, pictures=tuple(call.read(path) for path in pictures))
            return Fit._of(call.json(folder / "fit.json"), report)

    def diagnose(
        self,
        records: Records,
        validation: Record | None = None,
        without: str | Sequence[str] | None = None,
        *,
        calibrate: int = 0,
        quick: bool = False,
        step_of_record: bool = False,
        columns: Mapping[str, str] | None = None,
        seed: int = 1,
        out: Path_ | None = None,
    ) -> Diagnosis:
        """Diagnose what the twin lacks: whether parameters explain the records, and if not, which effect is missing and where.

        For a callable, effects of its sensors and actuators can be named, and a gap elsewhere is stated without a name. The noise
        level of a callable without `seed` is fitted, and is no gap.

        Parameters
        ----------
        records : record or sequence of records
            Measured records of one system, as for `fit`.
        validation : record, optional
            Record that no fit uses: the closed share of the gap is measured on it.
        without : str or sequence of str, optional
            Effects to exclude, as ``"sensor-bias"`` or ``"state-ceiling@h1"``.
        calibrate : int, optional
            Number of records of the fitted twin that are diagnosed alike, for a p-value.
        quick : bool, optional
            Try effects one at a time, from few starts, without pairs, smallest visible effects or next input.
        step_of_record : bool, optional
            Take records whose step is not the twin's: the twin then steps as they do.
        columns, seed, out
            As for `fit`.

        Returns
        -------
        Diagnosis
        """
        with _Call(self) as call:
            files = call.records(records, columns)
            options = [*call.subject(), *call.columns(columns), *_option("--calibrate", calibrate, 0)]
            options += _flags(quick=quick, step_of_record=step_of_record)
            if validation is not None:
                options += ["--validation", call.record("validation", validation, columns)]
            excluded = [without] if isinstance(without, str) else _texts("without", () if without is None else without)
            if not all(effect.strip() for effect in excluded):
                raise ValueError("without: an empty text; give an effect, as effects() lists them")
            if isinstance(self._model, Model) and not self._model.takes_seed and self._study is None:
                # The noise level of such a twin is fitted in every hypothesis. As an effect it would count twice, and be a gap.
                excluded.append("sensor-noise")
            if excluded:
                options.append(f"--without={','.join(excluded)}")
            folder, text = call.folder("diagnose", [*files, *options], seed, out)
            report = Report(text, page=call.read(folder / "report.html"))
            return Diagnosis._of(call.json(folder / "report.json"), report)

    def pretrain(
        self,
        out: Path_,
        *,
        bank_size: int | None = None,
        epochs: int | None = None,
        seed: int = 1,
    ) -> Estimator:
        """Train an estimator of this twin on simulations; once for a twin and its settings.

        Parameters
        ----------
        out : path
            New file of the estimator. A call that was stopped goes on where it was.
        bank_size, epochs : int, optional
            Number of simulations, and of passes over them. The defaults are those of the program.
        seed : int, optional
            The same seed gives the same estimator.

        Returns
        -------
        Estimator
            Its file is an argument of `estimate`.
        """
        with _Call(self) as call:
            options = [*call.subject(noise=True), "--out", word(out, "out"), *_option("--bank-size", bank_size, 1), *_option("--epochs", epochs, 1)]
            raw = json.loads(call.run("pretrain", [*options, "--json"], seed))
            return Estimator._of(raw, Path(out))

    def estimate(
        self,
        record: Record,
        estimator: Estimator | Path_,
        *,
        validation: Record | None = None,
        always_refine: bool = False,
        step_of_record: bool = False,
        columns: Mapping[str, str] | None = None,
        seed: int = 1,
        out: Path_ | None = None,
    ) -> Estimate:
        """Estimate the parameters behind a record with a trained estimator.

        Parameters
        ----------
        record : record
            One record, as for `fit`.
        estimator : Estimator or path
            Estimator from `pretrain` of the same twin.
        validation : record, optional
            Second record of the same system, to score the calibrated twin.
        always_refine : bool, optional
            Refine even if the record is consistent with the network's estimate.
        step_of_record : bool, optional
            Take a record whose step is not the estimator's, as for `diagnose`.
        columns, seed, out
            As for `fit`.

        Returns
        -------
        Estimate
        """
        with _Call(self) as call:
            options = [call.record("record", record, columns), *call.columns(columns), "--estimator", word(estimator, "estimator")]
            # An estimator of other equations would answer, too.
            options += call.subject(noise=True)
            if validation is not None:
                options += ["--validation", call.record("validation", validation, columns)]
            options += _flags(always_refine=always_refine, step_of_record=step_of_record)
            folder, text = call.folder("estimate", options, seed, out)
            report = Report(text, pictures=(call.read(folder / "overlay.svg"),))
            return Estimate._of(call.json(folder / "estimate.json"), report)

    @overload
    def simulate(
        self, parameters: Mapping[str, float], inputs: pd.DataFrame, *, noise_free: bool = False, seed: int = 1
    ) -> pd.DataFrame: ...

    @overload
    def simulate(
        self,
        parameters: Mapping[str, float],
        inputs: str | os.PathLike[str] | Mapping[str, Any] | None = None,
        *,
        noise_free: bool = False,
        seed: int = 1,
    ) -> dict[str, Array]: ...

    def simulate(
        self, parameters: Mapping[str, float], inputs: Record | None = None, *, noise_free: bool = False, seed: int = 1
    ) -> Any:
        """Simulate a record.

        Parameters
        ----------
        parameters : dict of str to float
            Value of each parameter.
        inputs : record, optional
            Times and inputs, without outputs. The default is random levels, as in the study.
        noise_free : bool, optional
            Leave out all noise.
        seed : int, optional
            Seed of the inputs and the noise.

        Returns
        -------
        dict of str to array, or DataFrame
            The record; a DataFrame if `inputs` is one.
        """
        with _Call(self) as call:
            given = named("parameters", parameters, "name: number")
            values = {name: number(f"parameters: {name}", value, "give a number") for name, value in given.items()}
            theta = ",".join(f"{name}={value!r}" for name, value in values.items())
            file = call.path / "simulated.csv"
            options = [*call.subject(noise=True), f"--theta={theta}", "--out", str(file)]
            if inputs is not None:
                options += ["--input", call.record("input", inputs, None, driven=True)]
            options += _flags(noise_free=noise_free)
            call.run("simulate", options, seed)
            model = self._model or self._text
            record = _records.read(file, list(model.inputs) if model else [], list(model.outputs) if model else [])
            return _records.as_frame(record) if _records.is_frame(inputs) else record

    def check(
        self, record: Record | None = None, *, columns: Mapping[str, str] | None = None, seed: int = 1
    ) -> Check:
        """Check the twin for mistakes; with a record, check whether it suits the twin.

        Parameters
        ----------
        record : record, optional
            Measured record.
        columns, seed
            As for `fit`.

        Returns
        -------
        Check
        """
        with _Call(self) as call:
            if record is None and columns:
                raise ValueError("columns are those of a record; give it, too")
            files = [] if record is None else [call.record("record", record, columns), *call.columns(columns)]
            # A failed check is an answer with exit code 1.
            raw = json.loads(call.run("check", [*files, *call.subject(noise=True), "--json"], seed, answers=(0, 1)))
            for finding in raw["findings"]:
                finding["message"] = call.names.finding("record", finding["message"])
            return Check._of(raw)

    def effects(self) -> list[str]:
        """Return the effects that may be added to this twin, as ``"sensor-bias@sensor"``: those that `diagnose` looks for, and `without` leaves out.

        Returns
        -------
        list of str
        """
        with _Call(self) as call:
            listed = json.loads(call.run("effects", [*call.subject(), "--json"]))["effects"]
            return [f"{effect['id']}@{target}" for effect in listed for target in effect["targets"]]

    def withheld(
        self,
        trials: int,
        *,
        detection_only: bool = False,
        validation: bool = False,
        kinds: str | Sequence[str] | None = None,
        like: Record | None = None,
        columns: Mapping[str, str] | None = None,
        seed: int = 1,
        out: Path_ | None = None,
    ) -> Scorecard:
        """Score `diagnose` on simulated records whose truth is sealed; takes seconds to minutes per trial.

        Parameters
        ----------
        trials : int
            Number of trials, one record each.
        detection_only : bool, optional
            Stop each diagnosis at its verdict.
        validation : bool, optional
            Give each diagnosis a validation record.
        kinds : str or sequence of str, optional
            Kinds of truth, as ``truetwin withheld --help`` lists them. The default is all that the program has for this twin.
        like : record, optional
            Measured record whose inputs, length, step and gaps the trials have. The default is the twin's plan.
        columns, seed
            As for `fit`.
        out : path, optional
            Folder that keeps the program's files; the same call with the same folder goes on where it was stopped.

        Returns
        -------
        Scorecard
        """
        with _Call(self) as call:
            options = [*call.subject(noise=True), "--trials", str(count("trials", trials, 1))]
            if kinds is not None:
                options.append(f"--kinds={','.join([kinds] if isinstance(kinds, str) else _texts('kinds', kinds))}")
            options += _flags(detection_only=detection_only, validation=validation)
            if like is None and columns:
                raise ValueError("columns are those of the record `like`; give it, too")
            if like is not None:
                options += ["--like", call.record("like", like, columns), *call.columns(columns)]
            folder, text = call.folder("withheld", options, seed, out)
            return Scorecard._of(call.json(folder / "scorecard.json"), Report(text, page=call.read(folder / "scorecard.html")))


class _Call:
    """One call of the program: its temporary folder, and the server of a callable."""

    def __init__(self, twin: Twin) -> None:
        self._twin = twin
        self._model = twin._model
        self._stack = ExitStack()
        self._server: Server | None = None
        self._writer: _records.Writer | None = None

    def __enter__(self) -> _Call:
        with ExitStack() as stack:
            self.path = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="truetwin-")))
            self.names = Names(self.path, in_arguments=self._twin._study is None)
            if self._model is not None:
                self._model.failure = None
                self._server = stack.enter_context(Server(self._model))
                # The callable is known by its name; the command of the relay says nothing to a user.
                self.names.say(self._server.command, str(self._model.name))
                if self._server.folder:
                    self.names.hide(self._server.folder)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def records(self, records: Records, columns: Mapping[str, str] | None) -> list[str]:
        """Return the paths of records, after writing those that are no files."""
        given = _records.as_list(records)
        return [self.record(f"record {at}", record, columns) for at, record in enumerate(given, start=1)]

    def record(self, name: str, record: Record, columns: Mapping[str, str] | None, driven: bool = False) -> str:
        """Return the path of a record, after writing it if it is no file; `name` is that of messages, and one that is `driven` needs no outputs."""
        if self._writer is None:
            model = self._model or self._twin._text
            inputs, outputs, step = (list(model.inputs), list(model.outputs), model.step) if model else (None, None, None)
            self._writer = _records.Writer(self.names, columns, inputs, outputs, step)
        return self._writer.path(name, record, driven)

    def columns(self, columns: Mapping[str, str] | None) -> list[str]:
        """Return the option that names columns."""
        return [f"--columns={_records.columns_of(columns)}"] if columns else []

    def subject(self, noise: bool = False) -> list[str]:
        """Return the options that name the twin."""
        twin = self._twin
        if twin._study is not None:
            return ["--study", str(twin._study)]
        if twin._text is not None:
            file = self.path / "twin.toml"
            file.write_text(twin._text.text, encoding="utf-8")
            # The user has no such file, but the method that returns its text.
            self.names.say(str(file), "toml()")
            return ["--study", str(file)]
        if self._model is None:
            return ["--twin", str(twin.name)]
        if noise and twin._noise and isinstance(self._model, Model):
            study = self.path / "study.toml"
            study.write_text(_study(self._model, twin._noise), encoding="utf-8")
            # It holds the noise alone, and is no file of the user.
            self.names.say(f"{study}: ", "")
            return ["--study", str(study)]
        return []

    def run(self, verb: str, options: Sequence[str], seed: int = 1, *, answers: Sequence[int] = (0,)) -> str:
        """Run a verb and return what it prints."""
        words = [verb, *options, "--seed", str(count("seed", seed, 0, LARGEST_SEED)), *_option("--threads", self._twin._threads, 1)]
        environment = {}
        if self._server is not None:
            words += ["--program", self._server.command]
            words += ["--workers", str(self._twin._workers), "--timeout", repr(self._twin._timeout)]
            environment = self._server.environment
        try:
            return self.names.plain(_process.run(words, environment, self.names, answers=answers))
        except TruetwinError as error:
            failure = self._model.failure if self._model else error.__cause__
            raise type(error)(one_line(self.names.message(error.line)), error.exit_code) from failure

    def read(self, path: Path) -> str:
        """Return the text of a result in the words of the user."""
        return self.names.plain(path.read_text(encoding="utf-8"))

    def json(self, path: Path) -> Json:
        """Return a result of the program in the words of the user."""
        raw: Json = json.loads(self.read(path))
        for warning in raw.get("warnings", ()):
            warning.update({key: self.names.argued(warning[key]) for key in ("what", "remedy")})
        return raw

    def folder(self, verb: str, options: Sequence[str], seed: int, out: Path_ | None) -> tuple[Path, str]:
        """Run a verb that fills a folder; return the folder and what it prints."""
        folder = self.path / "result" if out is None else Path(word(out, "out"))
        return folder, self.run(verb, [*options, "--out", word(folder)], seed)


def _flags(**given: bool) -> list[str]:
    """Return the options of the arguments that are true."""
    return [f"--{name.replace('_', '-')}" for name, value in given.items() if flag(name, value)]


def _texts(what: str, value: Any) -> list[str]:
    """Return a list of texts; refuse anything else."""
    texts = value if isinstance(value, Sequence) else None
    if texts is None or not all(isinstance(text, str) for text in texts):
        raise TypeError(f"{what} = {shown(value)}; give a text or a list of texts")
    return list(texts)


def _noise_levels(noise: float | Mapping[str, Any] | None, outputs: States, states: Sequence[str] = (), expressions: bool = False) -> dict[str, Any]:
    """Return the noise of the call by output: a number is that of each. By name, states may have one, too, and one may be an expression."""
    names = list(outputs)
    levels = noise if isinstance(noise, Mapping) else {} if noise is None else dict.fromkeys(names, noise)
    if unknown := set(levels) - {*names, *states}:
        raise ValueError(f"noise of {', '.join(sorted(map(str, unknown)))}; the outputs are {', '.join(names)}")
    keeps = expressions and isinstance(noise, Mapping)
    return {name: level if keeps and is_expression(level) else noise_level(name, level) for name, level in levels.items()}


def _noisy(entries: States, levels: Mapping[str, Any], key: str, function: Equation | None) -> dict[str, Entry]:
    """Return entries of states or outputs with their noise."""
    # What a function computes has a unit in place of an expression.
    key = "unit" if function else key
    noisy: dict[str, Entry] = {}
    for name, entry in (entries if isinstance(entries, Mapping) else dict.fromkeys(entries, {})).items():
        level = levels.get(name)
        if level is not None and isinstance(entry, Mapping) and "noise" in entry:
            raise ValueError(f"noise of {name} is given twice, here and in its entry; give one")
        noisy[name] = entry if level is None else {**(entry if isinstance(entry, Mapping) else {key: entry}), "noise": level}
    return noisy


def _option(name: str, value: int | None, least: int) -> list[str]:
    """Return an option with a whole number; none without a value."""
    return [] if value is None else [name, str(count(name[2:].replace("-", "_"), value, least))]


def _study(model: Model, noise: Mapping[str, float]) -> str:
    """Return a study file that adds measurement noise to the outputs of a model."""
    effects = [f"twin = {json.dumps(model.name)}"]
    for number, name in enumerate(model.outputs, start=1):
        if name in noise:
            target = "sensor" if len(model.outputs) == 1 else f"sensor{number}"
            effects.append(f'[[effect]]\nid = "sensor-noise"\ntarget = "{target}"\nmagnitudes = {{ std = {noise[name]!r} }}')
    return "\n".join(effects) + "\n"
