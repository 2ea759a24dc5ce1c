"""Ensembles: a ready system for every row of a table."""

import numpy as np

from . import _ricochet
from ._network import set_gate
from ._ready import Ready
from ._run import number_from, numbers_from, set_mode, set_tolerance

_COUNTS = ("events", "steps", "rejected", "flow_calls", "guard_calls")
_BLOCK = 256  # number of rows submitted to an executor at a time


class Ensemble:
    """Results of an ensemble, row by row.

    rows : ndarray
        A structured array with the fields ``outcome``, ``t``, ``x`` (the final state), ``mode``,
        ``events`` (how many), ``steps``, ``rejected``, ``flow_calls`` and ``guard_calls``. A field
        is also an attribute. ``outcome`` is ``"failed"`` for a row whose run raised an exception,
        and empty for a row that was not run.
    failures : dict
        The message of every row that failed.
    complete : bool
        Whether all rows were run.
    """

    def __init__(self, rows, failures, complete):
        self.rows = rows
        self.failures = failures
        self.complete = complete

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
    found = _ricochet.ensemble(name, names, parameters, starts, options, threads, progress)
    count, width = starts.shape
    rows = np.zeros(count, [("outcome", "U24"), ("t", float), ("x", float, (width,)),
                            ("mode", np.uint32), *((c, np.uint64) for c in _COUNTS)])
    rows["outcome"] = found["outcome"]
    rows["t"] = found["t"]
    rows["x"] = found["x"].reshape(count, width)
    rows["mode"] = found["mode"]
    for i, name in enumerate(_COUNTS):
        rows[name] = found["counts"].reshape(count, len(_COUNTS))[:, i]
    # A run that was stopped in its last chunk has no outcome.
    complete = found["complete"] and not (rows["outcome"] == "").any()
    return Ensemble(rows, found["failures"], bool(complete))


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
    rest = parts[0].rows[:0].copy()
    rest.resize(total - sum(map(len, parts)))
    rest["t"] = np.nan
    rest["x"] = np.nan
    return _joined([*parts, Ensemble(rest, {}, False)], [*begins[:len(parts)], 0])


def ensemble(system, table, t_end, *, columns=None, x0=None, threads=None, executor=None,
             progress=None, mode=None, **options):
    """Integrates a ready system for every row of a table, on all cores.

    Parameters
    ----------
    system : a ready system, or its class
        Gives the parameters that are not columns of the table.
    table : dict of arrays, structured array, or array_like of shape (rows, columns)
        Columns are parameters of the system or components of its initial state.
    t_end : float
    columns : sequence of str
        The names of the columns of an array without fields.
    x0 : array_like
        The initial state of components that are not columns; by default ``system.start``.
    threads : int
        By default one for each core that the process may use. The results do not depend on it.
    executor
        If given, blocks of rows are submitted to it: an executor of `concurrent.futures` or
        `mpi4py.futures`, or a client of `dask.distributed`. The results are the same.
    progress : callable
        Called regularly with the number of finished rows and the number of rows; if it returns
        False, the ensemble ends with the results so far.
    mode
        Initial mode of all rows.
    **options
        As for `integrate`, except for options that record results along the way: events are only
        counted.

    Returns
    -------
    Ensemble
    """
    if isinstance(system, type) and issubclass(system, Ready):
        system = system()
    if not isinstance(system, Ready):
        raise TypeError(f"system: found a {type(system).__name__}, expected a ready system or its "
                        "class")
    for option in ("record_steps", "record_events", "event_states", "sample_times", "dense"):
        if option in options:
            raise TypeError(f"{option}: found in an ensemble, which keeps the ends of its runs; "
                            "expected it in integrate")
    if threads is not None and (isinstance(threads, bool) or not isinstance(threads, int)
                                or not 1 <= threads <= 1024):
        raise ValueError(f"threads: found {threads!r}, expected a whole number from 1 to 1024")
    if executor is not None and threads is not None:
        raise TypeError("threads: found together with an executor, which has its own")
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise TypeError(f"executor: found a {type(executor).__name__}, expected one with submit()")
    parameters, starts = _tables(system, _columns_of(table, columns), x0)
    options["t_end"] = number_from(t_end, "t_end")
    if mode is not None:
        options["mode"] = mode
        set_mode(options, system, None)
    if not isinstance(options.get("atol", 0), (float, int)):
        set_tolerance(options, options["atol"], starts.shape[1])
    names = [name.replace("_", "-") for name in system.parameters]
    arguments = (system._name, names, parameters, starts)
    if executor is not None and len(starts) > 0:
        return _run_by(executor, arguments, options, progress)
    return _run(*arguments, options, threads or 0, progress)


def row_seed(seed, index):
    """Seed of the random numbers of row ``index``, as `ensemble` in C++ has it."""
    return _ricochet.row_seed(seed, index)
