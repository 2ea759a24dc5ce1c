"""Ensembles of a caller's own systems: each row by `integrate`, here or in an executor."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from . import _ricochet
from ._filippov import Filippov
from ._numbers import number_from, numbers_from
from ._run import Simulation, integrate, prepare
from ._system import System

COUNTS = ("events", "steps", "rejected", "flow_calls", "guard_calls")
_BLOCK = 16  # number of rows submitted to an executor at a time


class Parameters:
    """The columns of ``parameters``, and a system for each row of them."""

    def __init__(self, given, system):
        self.names, self.columns = None, []
        if given is None:
            return
        if isinstance(system, System):
            raise TypeError(f"parameters: found some beside a {type(system).__name__} that is made "
                            "already, expected a function of the parameters that makes it, such as "
                            "its class")
        if isinstance(given, np.ndarray) and given.dtype.names is not None:
            given = {name: given[name] for name in given.dtype.names}
        if hasattr(given, "items"):
            self.names = [str(name) for name, _ in given.items()]
            self.columns = [np.asarray(values) for _, values in given.items()]
        else:
            array = np.asarray(given)
            if array.ndim not in (1, 2):
                raise ValueError(f"parameters: found {array.ndim} dimensions, expected rows of "
                                 "parameters")
            self.columns = list(array.reshape(len(array), -1).T)
        shapes = {column.shape for column in self.columns}
        if len(shapes) != 1 or len(next(iter(shapes))) != 1:
            raise ValueError(f"parameters: found columns of the shapes {sorted(shapes)}, expected "
                             "one length for all")

    def rows(self):
        """The number of rows; None without parameters."""
        return len(self.columns[0]) if self.columns else None

    def block(self, begin, end):
        """The rows from ``begin`` to ``end``, as positional or keyword arguments of each."""
        if not self.columns:
            return [((), {})] * (end - begin)
        rows = zip(*(column[begin:end].tolist() for column in self.columns))
        if self.names is None:
            return [(row, {}) for row in rows]
        return [((), dict(zip(self.names, row))) for row in rows]

    def inputs(self):
        """The columns by name."""
        names = self.names or [f"parameter{i}" for i in range(len(self.columns))]
        return dict(zip(names, self.columns))


def _said(row, error):
    """What a failed row says: which one it is, the exception, and the last time that the run reached."""
    run = getattr(error, "ricochet_run", None)
    where = "" if run is None else f" (after t = {run.t:.17g})"
    return f"row {row}: {type(error).__name__}: {error}{where}"


def _mode_number(run):
    return run.mode if run.modes is None else list(run.modes).index(run.mode)


def run_block(system, first, starts, parameters, t_end, options):
    """Runs rows; executors call it, so all its arguments must be picklable."""
    done, failures, events, states = [], {}, [], []
    names = modes = None
    is_made = isinstance(system, System)
    is_prepared = is_made and not isinstance(system, Filippov)  # whose mode depends on the start
    if is_prepared:  # formulas are recorded once for all rows
        source, _, common, mode_list = prepare(system, starts[0], t_end, options)
    for row, (x0, (given, named)) in enumerate(zip(starts, parameters), first):
        try:
            if is_prepared:
                run = _ricochet.integrate(source, x0.tolist(), common, mode_list)
            else:
                run = integrate(system if is_made else system(*given, **named), x0, t_end, **options)
        except Exception as error:
            failures[row] = _said(row, error)
            done.append(("failed", np.nan, np.empty(0), 0, (0,) * len(COUNTS)))
            continue
        counts = run.statistics
        done.append((run.outcome, run.t, np.array(run.x), _mode_number(run),
                     tuple(getattr(counts, name) for name in COUNTS)))
        events.append((row, np.array(run.events)))
        if "sample_times" in options:
            states.append((row, np.array(run.states)))
        if names is None:
            names, modes = list(run.guard_names), run.modes
    return done, failures, events, states, names, modes


def _refuse_unpicklable(system, error):
    """Says what a process pool needs, where its complaint was about the system."""
    try:
        pickle.dumps(system)
    except Exception as reason:
        raise TypeError(f"system: found one that cannot be sent to another process ({reason}); "
                        "expected a class or functions at the top level of a module that the "
                        "processes can import, no lambdas and no compiled functions; threads take "
                        "any system") from error


def _blocks(system, starts, parameters, t_end, options, executor, progress):
    """The blocks in the order of their rows, and whether these are all rows."""
    total = len(starts)
    blocks = [(begin, min(begin + _BLOCK, total)) for begin in range(0, total, _BLOCK)]
    tasks = [(system, begin, starts[begin:end], parameters.block(begin, end), t_end, options)
             for begin, end in blocks]
    futures = [] if executor is None else [executor.submit(run_block, *task) for task in tasks]
    found = []
    try:
        for task, (_, end) in zip(tasks, blocks):
            if executor is None:
                found.append(run_block(*task))
            else:
                try:
                    found.append(futures[len(found)].result())
                except Exception as error:  # of the executor: those of rows are results
                    _refuse_unpicklable(system, error)
                    raise
            if progress is not None and progress(end, total) is False and end < total:
                return found, False
    finally:
        for future in futures[len(found):]:
            future.cancel()
    return found, True


def _event_table(arrays, kind, width):
    """The events of rows in one table, whose states have a common width."""
    fields = [(name, kind[name]) if name not in ("before", "after") or kind[name].shape == (0,)
              else (name, float, (width,)) for name in kind.names]
    arrays = [(row, array) for row, array in arrays if len(array)]
    out = np.zeros(sum(len(array) for _, array in arrays), [("row", np.int64), *fields])
    out["row"] = np.repeat([row for row, _ in arrays], [len(array) for _, array in arrays])
    parts = [array for _, array in arrays]
    if len({array.dtype for array in parts}) == 1:  # mostly: all fields at once
        parts = [np.concatenate(parts)]
    begin = 0
    for array in parts:
        part = out[begin:begin + len(array)]
        for name in kind.names:
            if array.dtype[name].shape == part.dtype[name].shape:
                part[name] = array[name]
            else:
                part[name] = np.nan
                part[name][:, :array[name].shape[1]] = array[name]
        begin += len(array)
    return out


def _checked(system, starts, t_end, options):
    """Refuses what no row can be run with; the fields of events."""
    for option in ("record_steps", "dense"):
        if option in options:
            raise TypeError(f"{option}: found in an ensemble, which keeps states at sample_times "
                            "only; expected it in integrate")
    x0 = starts[0].tolist()
    modes = None
    if isinstance(system, System):
        _, _, _, modes = prepare(system, x0, t_end, options)
    # What belongs to one system is left to its rows.
    common = {name: value for name, value in options.items()
              if name not in ("mode", "detector", "gate", "stop_at_event", "max_steps")
              and (name, value) != ("method", "taylor")}
    still = System(lambda t, x: 0 * x, [lambda t, x: 1.0])
    end = t_end if abs(t_end) != np.inf else options.get("t_start", 0.0) + np.copysign(1.0, t_end)
    return Simulation(still, x0, end, **common).run.events.dtype


def run_rows(system, starts, t_end, parameters, threads, executor, progress, options):
    """The keyword arguments of an `Ensemble` of own systems."""
    columns = Parameters(parameters, system)
    if hasattr(starts, "items"):
        raise TypeError("starts: found columns with names, which are for a ready system; expected "
                        "initial states, shape (rows, components)")
    starts = numbers_from(starts, "starts")
    rows = columns.rows()
    if starts.ndim == 1 and rows is not None:
        starts = np.tile(starts, (rows, 1))
    if starts.ndim != 2 or starts.shape[1] == 0:
        raise ValueError(f"starts: found shape {starts.shape}, expected (rows, components)"
                         + (", or with parameters (components,)" if rows is None else ""))
    if rows is not None and rows != len(starts):
        raise ValueError(f"parameters: found {rows} rows, expected {len(starts)}, as there are "
                         "starts")
    t_end = number_from(t_end, "t_end")
    samples = options.get("sample_times")
    if samples is not None:
        options["sample_times"] = samples = numbers_from(samples, "sample_times")
    else:
        options.pop("sample_times", None)
    found, complete, kind = [], True, None
    if len(starts):
        kind = _checked(system, starts, t_end, options)
        arguments = system, starts, columns, t_end, options
        if executor is None and (threads or 1) > 1:
            with ThreadPoolExecutor(threads) as pool:
                found, complete = _blocks(*arguments, pool, progress)
        else:
            found, complete = _blocks(*arguments, executor, progress)
    return _joined(found, complete, kind, starts, samples, columns)


def _joined(found, complete, kind, starts, samples, columns):
    count = len(starts)
    done = [row for block in found for row in block[0]]
    events = [part for block in found for part in block[2]]
    kept = [part for block in found for part in block[3]]
    width = max([starts.shape[1], *(len(x) for _, _, x, _, _ in done),
                 *(array["after"].shape[1] for _, array in events),
                 *(array.shape[1] for _, array in kept)])
    out = np.zeros(count, [("outcome", "U24"), ("t", float), ("x", float, (width,)),
                           ("mode", np.uint32), *((name, np.uint64) for name in COUNTS)])
    out["t"] = out["x"] = np.nan
    ran = out[:len(done)]
    for i, (_, _, x, _, _) in enumerate(done):
        ran["x"][i, :len(x)] = x
    for name, index in (("outcome", 0), ("t", 1), ("mode", 3)):
        ran[name] = [row[index] for row in done]
    for i, name in enumerate(COUNTS):
        ran[name] = [row[4][i] for row in done]
    states = None
    if samples is not None:
        states = np.full((count, samples.size, width), np.nan)
        for row, array in kept:
            states[row, :array.shape[0], :array.shape[1]] = array
    names = [block[4:] for block in found if block[4] is not None]
    guard_names, modes = names[0] if names else ([], None)
    return dict(rows=out, complete=complete, inputs=columns.inputs(),
                failures={row: said for block in found for row, said in block[1].items()},
                event_table=None if kind is None else _event_table(events, kind, width),
                guard_names=guard_names, modes=modes, times=samples, states=states)
