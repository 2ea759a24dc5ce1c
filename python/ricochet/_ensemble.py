"""Ensembles: one run for every row of a table."""

import numpy as np

from . import _progress, _ricochet
from ._network import set_gate
from ._ready import Ready
from ._rows import empty_rows, rows_from, run_rows
from ._run import number_from, numbers_from, set_mode, set_tolerance
from ._system import System

_BLOCK = 256  # number of rows submitted to an executor at a time


class Ensemble:
    """Results of an ensemble, row by row.

    rows : ndarray, shape (rows,)
        A structured array with the fields ``outcome``, ``t``, ``x`` (the final state), ``mode`` (its
        number), ``events`` (how many), ``steps``, ``rejected``, ``flow_calls`` and ``guard_calls``. A
        field is also an attribute. ``outcome`` is ``"failed"`` for a row whose run raised an
        exception, and empty for a row that was not run.
    failures : dict
        The message of every row that failed.
    complete : bool
        Whether all rows were run.
    inputs : dict of ndarray
        The columns of the table, or of ``parameters``, by name.

    And of own systems:

    event_table : ndarray, shape (events of all runs,)
        A structured array with the fields of `Run.events` and, first, ``row``, in the order of rows
        and times; None for ready systems, whose events are counted.
    guard_names, modes : list
        What the numbers in ``guard``, ``mode``, ``mode_before`` and ``mode_after`` mean, in the first
        row that was run; ``modes`` is None where they have no names.
    times, states : ndarray, shapes (times,) and (rows, times, components)
        The ``sample_times`` and the states there; NaN after the end of a run. None without them.

    States that are shorter than others end in NaN.
    """

    def __init__(self, rows, failures, complete, *, inputs=None, event_table=None, guard_names=(),
                 modes=None, times=None, states=None):
        self.rows = rows
        self.failures = failures
        self.complete = complete
        self.inputs = inputs or {}
        self.event_table = event_table
        self.guard_names = list(guard_names)
        self.modes = modes
        self.times = times
        self.states = states

    def __len__(self):
        return len(self.rows)

    def __getattr__(self, name):
        rows = self.__dict__.get("rows")
        if rows is None or name not in rows.dtype.names:
            raise AttributeError(f"Ensemble has no {name!r}")
        return rows[name]

    def __repr__(self):
        names, counts = np.unique(self.rows["outcome"], return_counts=True)
        ends = ", ".join(f"{count} {name or 'not run'}" for name, count in zip(names, counts))
        return f"<Ensemble of {len(self)}: {ends}>"

    def _named(self, numbers):
        """Modes by name where they have names."""
        if self.modes is None:
            return numbers
        return np.array([str(getattr(mode, "name", mode)) for mode in self.modes])[numbers]

    def _columns(self, table, numbers):
        """The fields of a table as columns, a component of a state each."""
        columns = {}
        for name in table.dtype.names:
            field = table[name]
            if name in numbers:
                field = self._named(field)
            if field.ndim == 1:
                columns[name] = field
            else:
                columns.update({f"{name}[{i}]": field[:, i] for i in range(field.shape[1])})
        return columns

    def to_pandas(self, events=False):
        """The rows as a ``pandas.DataFrame``, the columns of `inputs` before those of `rows`.

        The final state has a column for each component, ``x[0]``, ``x[1]`` and so on, and modes
        have their names. With ``events=True`` the frame is that of `event_table`. ImportError
        where pandas is not installed.
        """
        try:
            import pandas
        except ImportError:
            raise ImportError("Ensemble.to_pandas needs pandas, which was not found") from None
        if events:
            self._need_events()
            columns = self._columns(self.event_table, ("mode_before", "mode_after"))
            return pandas.DataFrame(columns)
        columns = self._columns(self.rows, ("mode",))
        inputs = {name if name not in columns else f"{name} (given)": values
                  for name, values in self.inputs.items()}
        return pandas.DataFrame({**inputs, **columns},
                                index=pandas.RangeIndex(len(self), name="row"))

    def to_xarray(self):
        """The results as an ``xarray.Dataset``.

        Dimensions are ``row``, ``component``, with ``sample_times`` ``time``, and of own systems
        ``event``, whose variables begin with ``event_``; `inputs` are coordinates of ``row``.
        ImportError where xarray is not installed.
        """
        try:
            import xarray
        except ImportError:
            raise ImportError("Ensemble.to_xarray needs xarray, which was not found") from None
        variables = {}
        for name in self.rows.dtype.names:
            field = self._named(self.rows[name]) if name == "mode" else self.rows[name]
            variables[name] = (("row", "component")[:field.ndim], field)
        if self.states is not None:
            variables["states"] = (("row", "time", "component"), self.states)
        if self.event_table is not None:
            axes = {"bracket": "side"}
            for name in self.event_table.dtype.names:
                field = self.event_table[name]
                field = self._named(field) if name in ("mode_before", "mode_after") else field
                axis = ("event", axes.get(name, "component"))
                variables[f"event_{name}"] = (axis[:field.ndim], field)
        coordinates = {"row": np.arange(len(self))}
        if self.times is not None:
            coordinates["time"] = self.times
        for name, values in self.inputs.items():
            taken = name in variables or name in coordinates or name in ("component", "event")
            coordinates[f"{name} (given)" if taken else name] = ("row", values)
        return xarray.Dataset(variables, coordinates)

    def _need_events(self):
        if self.event_table is None:
            raise ValueError("events: found an ensemble of ready systems, which counts them; "
                             "expected one with parameters, or of a System")


def _columns_of(table, columns):
    """The table as a dictionary of columns."""
    if isinstance(table, np.ndarray) and table.dtype.names is not None:
        table = {name: table[name] for name in table.dtype.names}
    if hasattr(table, "items"):
        if columns is not None:
            raise TypeError("columns: found some for a table that names its own, expected none")
        found = {name: numbers_from(values, f"table[{name!r}]") for name, values in table.items()}
    else:
        array = numbers_from(table, "table")
        if columns is None or isinstance(columns, str):
            raise TypeError(f"columns: found {columns!r}, expected the names of the table's columns")
        if array.ndim != 2 or array.shape[1] != len(columns):
            raise ValueError(f"table: found shape {array.shape}, expected (rows, {len(columns)})")
        if len(set(columns)) != len(columns):
            raise ValueError(f"columns: found {list(columns)}, expected every name once")
        found = {name: array[:, i] for i, name in enumerate(columns)}
    if not found:
        raise ValueError("table: found no columns, expected at least one")
    rows = {values.shape for values in found.values()}
    if len(rows) != 1 or len(next(iter(rows))) != 1:
        raise ValueError("table: found columns of the shapes "
                         f"{ {name: values.shape for name, values in found.items()} }, expected "
                         "one length for all")
    for name, values in found.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise ValueError(f"table: found {values[bad[0]]} in row {bad[0]} of {name!r}, expected "
                             "finite numbers")
    return found


def _tables(system, found, x0):
    """The parameters and the starts of all rows."""
    known = list(system.parameters) + list(system.state)
    for name in found:
        if name not in known:
            from difflib import get_close_matches
            near = get_close_matches(str(name), known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ValueError(f"table: found a column {name!r}, expected some of {known}{hint}")
    rows = len(next(iter(found.values())))
    base = numbers_from(system.start if x0 is None else x0, "x0")
    if base.shape != (len(system.state),):
        raise ValueError(f"x0: found shape {base.shape}, expected ({len(system.state)},)")
    parameters = np.empty((rows, len(system.parameters)))
    starts = np.empty((rows, len(system.state)))
    for i, (name, value) in enumerate(system.parameters.items()):
        parameters[:, i] = found.get(name, value)
    for i, name in enumerate(system.state):
        starts[:, i] = found.get(name, base[i])
    return parameters, starts


def _run(name, names, parameters, starts, options, threads, progress=None):
    """Runs rows; executors call it, so all its arguments must be picklable."""
    options = dict(options)
    set_gate(options)
    found = _ricochet.ready_ensemble(name, names, parameters, starts, options, threads, progress)
    return Ensemble(rows_from(found, starts.shape[1]), found["failed"], found["complete"])


def _joined(parts, starts):
    failures = {start + row: message for part, start in zip(parts, starts)
                for row, message in part.failures.items()}
    return Ensemble(np.concatenate([part.rows for part in parts]), failures,
                    all(part.complete for part in parts))


def _run_by(executor, arguments, options, progress):
    """Submits blocks of rows to an executor and joins the results in order."""
    name, names, parameters, starts = arguments
    total = len(starts)
    begins = range(0, total, _BLOCK)
    futures = [executor.submit(_run, name, names, parameters[i:i + _BLOCK], starts[i:i + _BLOCK],
                               options, 1) for i in begins]
    parts = []
    try:
        for future in futures:
            parts.append(future.result())
            done = sum(map(len, parts))
            if progress is not None and progress(done, total) is False and done < total:
                break
    finally:
        for future in futures[len(parts):]:
            future.cancel()
    if len(parts) == len(futures):
        return _joined(parts, begins)
    rest = empty_rows(total - sum(map(len, parts)), starts.shape[1])
    return _joined([*parts, Ensemble(rest, {}, False)], [*begins[:len(parts)], 0])


def ensemble(system, table, t_end, *, parameters=None, columns=None, x0=None, threads=None,
             executor=None, progress=None, mode=None, **options):
    """Integrates a system for every row of a table.

    A ready system runs on all cores, without the interpreter. A system of one's own is run by
    `integrate` row by row; its events are kept.

    Parameters
    ----------
    system : a ready system, or its class; a `System`, or a function that makes one
        A ready system gives the parameters that are not columns of the table. A function, such as
        the class of a system, is called for each row of ``parameters``; it may return a ready
        system, too.
    table : dict of arrays, structured array, or array_like of shape (rows, columns)
        For a ready system: columns are parameters or components of the initial state. For others:
        the initial states, shape (rows, components), or with ``parameters`` also one for all rows.
    t_end : float
    parameters : dict of arrays, structured array, or array_like of shape (rows,) or (rows, columns)
        Arguments of ``system``, by name or, in an array without fields, by position.
    columns : sequence of str
        Of a ready system, the names of the columns of an array without fields.
    x0 : array_like
        Of a ready system, the initial state of components that are not columns; by default
        ``system.start``.
    threads : int
        By default one for each core that the process may use, and one for systems of one's own
        that need the interpreter, in which threads take turns. The results do not depend on it.
    executor
        If given, blocks of rows are submitted to it: an executor of `concurrent.futures` or
        `mpi4py.futures`, or a client of `dask.distributed`. The results are the same. To other
        processes a system must be sent, so for a process pool its class or functions stand at the
        top level of an importable module.
    progress : bool or callable
        True: a bar is shown, by tqdm where that is installed. A function is called regularly with
        the number of finished rows and the number of rows; if it returns False, the ensemble ends
        with the results so far.
    mode
        Initial mode of all rows.
    **options
        As for `integrate`, except for ``record_steps``, and for ready systems except for all
        options that record results along the way.

    Returns
    -------
    Ensemble

    A row whose run raises an exception, also in a function of the system, has the outcome
    ``"failed"`` and a message that names it; the other rows are run. TypeError or ValueError for
    arguments with which no row can be run.
    """
    if threads is not None and (isinstance(threads, bool) or not isinstance(threads, int)
                                or not 1 <= threads <= 1024):
        raise ValueError(f"threads: found {threads!r}, expected a whole number from 1 to 1024")
    if executor is not None and threads is not None:
        raise TypeError("threads: found together with an executor, which has its own")
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise TypeError(f"executor: found a {type(executor).__name__}, expected one with submit()")
    progress = _progress.check(progress)
    if progress is True:
        bar = _progress.OfRows(_rows_of(table, parameters))
        try:
            return ensemble(system, table, t_end, parameters=parameters, columns=columns, x0=x0,
                            threads=threads, executor=executor, progress=bar, mode=mode, **options)
        finally:
            bar.close()
    if mode is not None:
        options["mode"] = mode
    is_ready = isinstance(system, Ready) or isinstance(system, type) and issubclass(system, Ready)
    if isinstance(system, System) or callable(system) and (not is_ready or parameters is not None):
        for name, given in (("columns", columns), ("x0", x0)):
            if given is not None:
                raise TypeError(f"{name}: found some for a system that is not a ready one, expected "
                                "initial states and parameters")
        return Ensemble(**run_rows(system, table, t_end, parameters, threads, executor, progress,
                                   options))
    return _of_ready(system, table, t_end, parameters, columns, x0, threads, executor, progress,
                     options)


def _rows_of(table, parameters):
    """About how many rows there are, for a bar; None where that is not plain to see."""
    for given in (parameters, table):
        if given is None:
            continue
        try:
            return len(next(iter(given.values())) if hasattr(given, "items") else given)
        except (TypeError, StopIteration):
            return None


def _of_ready(system, table, t_end, parameters, columns, x0, threads, executor, progress, options):
    if isinstance(system, type) and issubclass(system, Ready):
        system = system()
    if not isinstance(system, Ready):
        raise TypeError(f"system: found a {type(system).__name__}, expected a System, a function "
                        "that makes one, or a ready system or its class")
    if parameters is not None:
        raise TypeError("parameters: found some beside a ready system that is made already, "
                        "expected its class, or the parameters in the table")
    for option in ("record_steps", "record_events", "event_states", "sample_times", "dense"):
        if option in options:
            raise TypeError(f"{option}: found in an ensemble of a ready system, which keeps the "
                            "ends of its runs; expected it in integrate, or in an ensemble with "
                            "parameters")
    found = _columns_of(table, columns)
    parameters, starts = _tables(system, found, x0)
    options["t_end"] = number_from(t_end, "t_end")
    set_mode(options, system, None)
    if not isinstance(options.get("atol", 0), (float, int)):
        set_tolerance(options, options["atol"], starts.shape[1])
    names = [name.replace("_", "-") for name in system.parameters]
    arguments = (system._name, names, parameters, starts)
    if executor is not None and len(starts) > 0:
        out = _run_by(executor, arguments, options, progress)
    else:
        out = _run(*arguments, options, threads or 0, progress)
    out.inputs = found
    out.modes = None if system.modes is None else list(system.modes)
    return out


def row_seed(seed, index):
    """Seed of the random numbers of row ``index``, an integer below 2**64, as `ensemble` in C++ has it.

    ``seed`` and ``index`` are integers that are not negative, below 2**64.
    """
    return _ricochet.row_seed(seed, index)
