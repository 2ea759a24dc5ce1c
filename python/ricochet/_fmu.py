"""Functional Mock-up Units: models of other tools, run with their events located."""

import math
import os
from collections.abc import MutableMapping
from types import SimpleNamespace

import numpy as np


def load_fmu(file):
    """Load an FMU of FMI 2.0 or 3.0.

    Parameters
    ----------
    file
        Path of the archive. It is unpacked into a temporary folder; its library is loaded when
        the first run starts, in this process.

    Returns
    -------
    Fmu

    Raises
    ------
    ValueError
        If the archive or its description is not that of an FMU, naming file, line and attribute.
    ImportError
        If this build of the package is without FMI.
    """
    return Fmu(file)


class Fmu:
    """A model of another tool.

    Attributes
    ----------
    name, version
        Name of the model; version of FMI, such as ``"3.0"``.
    variables
        Dictionary from names to namespaces with ``causality``, ``variability``, ``unit``,
        ``description``, ``start`` and ``dimensions``.
    parameters
        Mapping from names to numbers, which every later run starts with. Those that are not set
        have the FMU's own values.
    states
        Names of the components of the state.
    """

    def __init__(self, file):
        try:
            from . import _fmi
        except ImportError as error:
            raise ImportError("load_fmu: this build of ricochet is without FMI; expected one with "
                              "pugixml and minizip") from error
        self._fmu = _fmi.Fmu(os.fspath(file))
        told = self._fmu.describe()
        self.file = os.fspath(file)
        self.name, self.version, self.states = told["name"], told["version"], told["states"]
        self.variables = {name: SimpleNamespace(**of) for name, of in told["variables"].items()}
        self.parameters = _Parameters(self.variables)
        self._once_per_process = told["once_per_process"]
        self._t_start = 0.0 if told["t_start"] is None else told["t_start"]
        self._t_end = max(self._t_start + 1 if told["t_end"] is None else told["t_end"], self._t_start)

    def __repr__(self):
        return f"<Fmu {self.name}: FMI {self.version}, {len(self.states)} states>"

    def simulate(self, t_end=None, t_start=None, *, rtol=1e-8, method="automatic", h_max=math.inf,
                 start=None, inputs=None, output=None, sample_times=None, samples=501, step=None,
                 co_simulation=None, watch=None):
        """Run the model; every event is located to neighbouring floating-point numbers.

        Parameters
        ----------
        t_end, t_start
            Times [s]; default: those of the FMU.
        rtol
            Relative error allowed in a step; the absolute one is ``rtol`` times the nominal value
            of the state.
        method
            ``"dopri5"``, ``"fehlberg78"``, ``"rosenbrock4"`` for stiff motion, or ``"automatic"``.
        start
            Dictionary of further start values, by name.
        inputs
            Dictionary from names to tables ``(t, u)`` of one length, linear between rows (two rows
            of one time are a jump; discrete inputs are constant), or to smooth functions of time.
        output
            Names of recorded variables; default: the outputs.
        sample_times
            Ascending times [s] at which they are recorded; default: ``samples`` of them, evenly.
            Both sides of every event are recorded, too.
        step
            Length [s] of the steps of co-simulation.
        co_simulation
            Whether the FMU integrates itself; default: where it offers nothing else.
        watch
            Dictionary from names to levels, or to pairs of a level and a direction (-1 falling, 1
            rising, 0 either): passages are located by steps that are taken again, and are events
            with the cause ``"passage"`` and the name in ``watch``. For FMUs that keep their state;
            the run is one of co-simulation.

        Returns
        -------
        FmuRun
        """
        begin = self._t_start if t_start is None else float(t_start)
        end = max(self._t_end, begin) if t_end is None else float(t_end)
        if sample_times is None:
            sample_times = np.linspace(begin, end, samples)
        tables, functions = _tables_and_functions(inputs or {})
        watched = [(name, *(float(part) for part in np.atleast_1d(level)), 0)[:3]
                   for name, level in (watch or {}).items()]
        given = {"t_start": begin, "t_end": end, "rtol": float(rtol), "method": method,
                 "h_max": float(h_max), "step": None if step is None else float(step),
                 "co_simulation": True if watched else co_simulation,
                 "watch": [(name, level, int(crossing)) for name, level, crossing in watched],
                 "start": [(name, float(value)) for name, value in
                           {**self.parameters, **(start or {})}.items()],
                 "output": list(output or []),
                 "sample_times": np.asarray(sample_times, dtype=float).tolist(),
                 "tables": tables, "functions": functions}
        return FmuRun(self._fmu.run(given), [name for name, *_ in watched])

    def ensemble(self, table, t_end=None, t_start=None, *, threads=None, **options):
        """Run the model once for each row of a table of values.

        Parameters
        ----------
        table
            Dictionary from names of parameters or start values to sequences of one length.
        t_end, t_start, options
            As of `simulate`, for all runs.
        threads : int
            Runs at a time, each an instance of its own; default: one a processor. An FMU that may
            be instantiated once a process only is run in processes of its own, which a script
            must be able to import (``if __name__ == "__main__":``).

        Returns
        -------
        list of FmuRun
            In the order of the rows; the runs of `simulate`, bit for bit.

        Raises
        ------
        ValueError
            As `simulate`, and where the columns have different lengths.
        """
        columns = {name: np.asarray(values, dtype=float).ravel().tolist()
                   for name, values in table.items()}
        lengths = {len(values) for values in columns.values()}
        if len(lengths) != 1:
            raise ValueError("table: found columns of " + (" and ".join(map(str, sorted(lengths))) or "no")
                             + " rows, expected at least one column, and all of one length")
        if threads is None:
            threads = os.cpu_count() or 1
        if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
            raise ValueError(f"threads: found {threads!r}, expected a whole number from 1 on")
        common = {**self.parameters, **(options.pop("start", None) or {})}
        jobs = [(t_end, t_start, {**options, "start": {**common, **dict(zip(columns, row))}})
                for row in zip(*columns.values())]
        if self._once_per_process:
            from multiprocessing import get_context

            with get_context("spawn").Pool(min(threads, len(jobs)) or 1, maxtasksperchild=1) as pool:
                return pool.starmap(_run_file, [(self.file, *job) for job in jobs], chunksize=1)
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(threads) as pool:
            runs = [pool.submit(self.simulate, job[0], job[1], **job[2]) for job in jobs]
            try:
                return [run.result() for run in runs]
            except BaseException:
                for run in runs:
                    run.cancel()
                raise


def _run_file(file, t_end, t_start, options):
    return Fmu(file).simulate(t_end, t_start, **options)


def _tables_and_functions(inputs):
    tables, functions = [], []
    for name, value in inputs.items():
        if callable(value):
            functions.append((name, value))
            continue
        try:
            t, u = (np.asarray(part, dtype=float).ravel().tolist() for part in value)
        except (TypeError, ValueError):
            raise ValueError(f"simulate: found the input {name!r} = {value!r}; expected a table "
                             "(t, u) or a function of time") from None
        tables.append((name, t, u))
    return tables, functions


class _Parameters(MutableMapping):
    """Values of parameters that have been set."""

    def __init__(self, variables):
        self._known = {name for name, of in variables.items()
                       if of.causality == "parameter" and of.number}
        self._values = {}

    def __getitem__(self, name):
        return self._values[name]

    def __setitem__(self, name, value):
        if name not in self._known:
            raise KeyError(f"{name}: no parameter with a number; there are "
                           f"{', '.join(sorted(self._known)) or 'none'}")
        self._values[name] = float(value)

    def __delitem__(self, name):
        del self._values[name]

    def __iter__(self):
        return iter(self._values)

    def __len__(self):
        return len(self._values)

    def __repr__(self):
        return repr(self._values)


class FmuRun:
    """What a run of an FMU has given; ``run["h"]`` are the recorded values of ``h``.

    Attributes
    ----------
    t
        Times [s] of the recorded values, shape (n,); at an event there are two of one time.
    sides
        Shape (n,): -1 before an event, 1 after it, else 0.
    events
        List of namespaces with ``t`` [s], ``causes`` (of ``"state"``, ``"time"``, ``"step"``,
        ``"input"`` and ``"passage"``), ``indicator``, ``watch``, and the states ``before`` and
        ``after``.
    outcome, message, success
        ``"reached_end"``, ``"terminated"``, ``"chattering"``, ``"call_failed"`` or
        ``"not_integrated"``; a sentence; whether the run reached its end or the FMU asked for it.
    t_end, x
        Time [s] reached, and the state there.
    method, statistics, warnings
        The method that was used; counts of steps and calls; sentences.
    """

    def __init__(self, told, watched=()):
        self.outcome, self.message = told["outcome"], told["message"]
        self.success = self.outcome in ("reached_end", "terminated")
        self.t_end, self.x = told["t_end"], np.asarray(told["x"])
        self.t, self.sides, self.method = told["t"], told["sides"], told["method"]
        self.statistics = SimpleNamespace(**told["statistics"])
        self.warnings = told["warnings"]
        self.events = [SimpleNamespace(t=t, causes=causes, watch=None if watch is None else watched[watch],
                                       indicator=indicator, before=before, after=after)
                       for t, causes, watch, indicator, before, after in told["events"]]
        self._values = dict(zip(told["output"], told["values"].T))

    def __getitem__(self, name):
        if name in self._values:
            return self._values[name]
        raise KeyError(f"{name}: not recorded; recorded are {', '.join(self._values)}")

    def keys(self):
        """Names of the recorded variables."""
        return self._values.keys()

    def __repr__(self):
        return f"<FmuRun {self.outcome} at t = {self.t_end:.6g} s, {len(self.events)} events>"
