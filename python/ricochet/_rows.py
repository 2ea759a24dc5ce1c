"""Ensembles of a caller's own systems: without the interpreter where that can be, else row by row."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from . import _ricochet
from ._filippov import Filippov
from ._formula import ParameterTape
from ._kept import may_make, take_symbols
from ._numbers import number_from, numbers_from
from ._run import Simulation, integrate, prepare
from ._system import System

COUNTS = ("events", "steps", "rejected", "flow_calls", "guard_calls")
_BLOCK = 16  # number of rows submitted to an executor at a time


def empty_rows(count, width):
    """Rows that were not run, of states of ``width`` components."""
    rows = np.zeros(count, [("outcome", "U24"), ("t", float), ("x", float, (width,)),
                            ("mode", np.uint32), *((name, np.uint64) for name in COUNTS)])
    rows["t"] = rows["x"] = np.nan
    return rows


def rows_from(found, width):
    """The rows of what an ensemble in C++ has returned."""
    count = len(found["t"])
    rows = empty_rows(count, width)
    rows["outcome"] = np.array(found["outcomes"], "U24")[found["outcome"]]
    for name in ("t", "mode"):
        rows[name] = found[name]
    rows["x"] = found["x"].reshape(count, width)
    counts = found["counts"].reshape(count, len(COUNTS))
    for i, name in enumerate(COUNTS):
        rows[name] = counts[:, i]
    return rows


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

    def part(self, rows):
        """The parameters of some rows."""
        out = Parameters.__new__(Parameters)
        out.names, out.columns = self.names, [column[rows] for column in self.columns]
        return out

    def each(self, rows):
        """Positional and keyword arguments for each of ``rows`` rows."""
        if not self.columns:
            return [((), {})] * rows
        return [self._arguments(row) for row in zip(*(column.tolist() for column in self.columns))]

    def _arguments(self, row):
        return (row, {}) if self.names is None else ((), dict(zip(self.names, row)))

    def of_symbols(self, maker):
        """The system of all rows, made of symbols, and its table; None where it is not such a system."""
        floats = all(column.dtype.kind == "f" and column.itemsize <= 8 for column in self.columns)
        if not self.columns or not floats or not may_make(maker):
            return None
        tape = ParameterTape(len(self.columns))
        given, named = self._arguments(tuple(tape.symbols))
        try:
            system = maker(*given, **named)
            if not isinstance(system, System) or isinstance(system, Filippov) or system.formula is None:
                return None
            guards = system._guard_list()
            functions = [guard[key] for guard in guards for key in ("value", "reset", "rest")]
            if not take_symbols([system.flow, system.time_reset, *functions], system):
                return None
            return system, tape
        except Exception:  # it does with symbols what only numbers allow
            return None

    def inputs(self):
        """The columns by name."""
        names = self.names or [f"parameter{i}" for i in range(len(self.columns))]
        return dict(zip(names, self.columns))


class _Block:
    """What some rows have given: ``events`` beside the number of its row for each."""

    __slots__ = ("rows", "failures", "event_rows", "events", "states", "guard_names", "modes", "complete")

    def __init__(self, **parts):
        for name in self.__slots__:
            setattr(self, name, parts.get(name))

    def put(self, at, other):
        """Puts the rows of another block at these places of this one."""
        for name in ("rows", "states"):
            mine, its = getattr(self, name), getattr(other, name)
            if its is not None:
                mine[at] = its
        self.failures.update(other.failures)
        self.event_rows = np.concatenate([self.event_rows, other.event_rows])
        self.events += other.events


def _said(row, error):
    """What a failed row says: which one it is, the exception, and the last time that the run reached."""
    run = getattr(error, "ricochet_run", None)
    where = "" if run is None else f" (after t = {run.t:.17g})"
    return f"row {row}: {type(error).__name__}: {error}{where}"


def _mode_number(run):
    return run.mode if run.modes is None else list(run.modes).index(run.mode)


def run_each(system, numbers, starts, parameters, t_end, options):
    """Runs rows one by one; ``numbers`` are those by which failures name them."""
    done, failures, events, states = [], {}, [], []
    names = modes = None
    is_made = isinstance(system, System)
    is_prepared = is_made and not isinstance(system, Filippov)  # whose mode depends on the start
    if is_prepared:  # formulas are recorded once for all rows
        source, _, common, mode_list = prepare(system, starts[0], t_end, options)
    for row, x0, (given, named) in zip(numbers, starts, parameters.each(len(starts))):
        try:
            if is_prepared:
                run = _ricochet.integrate(source, x0.tolist(), common, mode_list)
            else:
                run = integrate(system if is_made else system(*given, **named), x0, t_end, **options)
        except Exception as error:
            failures[row] = _said(row, error)
            done.append(("failed", np.nan, np.empty(0), 0, (0,) * len(COUNTS)))
            states.append(np.empty((0, 0)))
            continue
        counts = run.statistics
        done.append((run.outcome, run.t, np.array(run.x), _mode_number(run),
                     tuple(getattr(counts, name) for name in COUNTS)))
        events.append((row, np.array(run.events)))
        states.append(np.array(run.states))
        if names is None:
            names, modes = list(run.guard_names), run.modes
    width = max([starts.shape[1], *(len(row[2]) for row in done), *(x.shape[1] for x in states),
                 *(array["after"].shape[1] for _, array in events)])
    rows = empty_rows(len(done), width)
    for row, (outcome, t, x, mode, counts) in zip(rows, done):
        row["outcome"], row["t"], row["mode"] = outcome, t, mode
        row["x"][:len(x)] = x
        for name, count in zip(COUNTS, counts):
            row[name] = count
    samples = options.get("sample_times")
    return _Block(rows=rows, failures=failures, guard_names=names, modes=modes, complete=True,
                  event_rows=np.repeat(np.array([row for row, _ in events], int),
                                       np.array([len(array) for _, array in events], int)),
                  events=[array for _, array in events if len(array)],
                  states=None if samples is None else _padded(states, np.size(samples), width))


def _padded(states, samples, width):
    """States at sample times as one array, NaN after the ends of runs."""
    out = np.full((len(states), samples, width), np.nan)
    for row, array in zip(out, states):
        row[:array.shape[0], :array.shape[1]] = array
    return out


class _Free:
    """A system whose runs need no interpreter, for all rows."""

    def __init__(self, system, source, modes, options, table, fine):
        self.system = system
        self.source, self.modes, self.options = source, modes, options
        self.table = table  # of the parameters that its formulas read
        self.fine = fine  # rows of which it is the system

    @staticmethod
    def of(system, starts, parameters, t_end, options):
        """None where a run may need the interpreter."""
        if isinstance(system, System):
            if isinstance(system, Filippov):
                return None
            source, _, common, modes = prepare(system, starts[0], t_end, options)
            table, fine = np.empty((len(starts), 0)), np.ones(len(starts), bool)
        else:
            found = parameters.of_symbols(system)
            if found is None:
                return None
            made, tape = found
            try:
                source, _, common, modes = prepare(made, starts[0], t_end, options)
            except Exception:  # its functions need numbers, or the rows will say what is wrong
                return None
            table, fine = tape.table([column.astype(float) for column in parameters.columns])
        return _Free(system, source, modes, common, table, fine) if source.is_free else None

    def run(self, numbers, starts, parameters, t_end, options, threads, progress):
        """The block of these rows; those that fail, or may, are run in Python, for their message."""
        some = slice(None) if self.fine.all() else np.flatnonzero(self.fine)
        found = _ricochet.own_ensemble(self.source, self.table[some], starts[some], self.options,
                                       threads, progress)
        places = np.arange(len(starts))[some]
        events = found["events"]
        samples = self.options.get("sample_times")
        rows = empty_rows(len(starts), starts.shape[1])
        rows[some] = rows_from(found, starts.shape[1])
        states = None
        if samples is not None:
            states = np.full((len(starts), len(samples), starts.shape[1]), np.nan)
            states[some] = found["states"].reshape(-1, len(samples), starts.shape[1])
        block = _Block(rows=rows, failures={}, states=states, complete=found["complete"],
                       event_rows=numbers[0] + np.repeat(places, found["event_counts"]),
                       events=[events] if len(events) else [], modes=self.modes,
                       guard_names=self.source.guard_names)
        again = sorted([*np.flatnonzero(~self.fine), *(places[row] for row in found["failed"])])
        if again and block.complete:
            block.put(again, run_each(self.system, [numbers[row] for row in again], starts[again],
                                      parameters.part(again), t_end, options))
        return block


def run_block(system, numbers, starts, parameters, t_end, options):
    """Runs rows; executors call it, so all its arguments must be picklable."""
    free = _Free.of(system, starts, parameters, t_end, options)
    if free is not None:
        return free.run(numbers, starts, parameters, t_end, options, 1, None)
    return run_each(system, numbers, starts, parameters, t_end, options)


def _refuse_unpicklable(system, error):
    """Says what a process pool needs, where its complaint was about the system."""
    try:
        pickle.dumps(system)
    except Exception as reason:
        raise TypeError(f"system: found one that cannot be sent to another process ({reason}); "
                        "expected a class or functions at the top level of a module that the "
                        "processes can import, no lambdas and no compiled functions; threads take "
                        "any system") from error


def _blocks(run, system, starts, parameters, t_end, options, executor, progress):
    """The blocks in the order of their rows, each by ``run``; fewer where the progress ends them."""
    total = len(starts)
    blocks = [range(begin, min(begin + _BLOCK, total)) for begin in range(0, total, _BLOCK)]
    tasks = [(system, rows, starts[rows.start:rows.stop], parameters.part(slice(rows.start, rows.stop)),
              t_end, options) for rows in blocks]
    futures = [] if executor is None else [executor.submit(run, *task) for task in tasks]
    found = []
    try:
        for task, rows in zip(tasks, blocks):
            if executor is None:
                found.append(run(*task))
            else:
                try:
                    found.append(futures[len(found)].result())
                except Exception as error:  # of the executor: those of rows are results
                    _refuse_unpicklable(system, error)
                    raise
            if progress is not None and progress(rows.stop, total) is False:
                break
    finally:
        for future in futures[len(found):]:
            future.cancel()
    return found


def _event_table(found, kind, width):
    """The events of rows in one table, whose states have a common width."""
    fields = [(name, kind[name]) if name not in ("before", "after") or kind[name].shape == (0,)
              else (name, float, (width,)) for name in kind.names]
    numbers = [block.event_rows for block in found]
    out = np.zeros(sum(map(len, numbers)), [("row", np.int64), *fields])
    parts = [array for block in found for array in block.events]
    if len({array.dtype for array in parts}) == 1:  # mostly: all fields at once
        parts = [np.concatenate(parts)] if len(parts) > 1 else parts
    if not parts:
        return out
    out["row"] = np.concatenate(numbers)
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
    rows = out["row"]
    return out if (rows[:-1] <= rows[1:]).all() else out[np.argsort(rows, kind="stable")]


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
    found, kind = [], None
    if len(starts):
        kind = _checked(system, starts, t_end, options)
        found = _run_all(system, starts, columns, t_end, options, threads, executor, progress)
    return _joined(found, kind, starts, samples, columns)


def _run_all(system, starts, parameters, t_end, options, threads, executor, progress):
    """The blocks of all rows, as far as they were run."""
    arguments = system, starts, parameters, t_end, options
    if executor is not None:
        return _blocks(run_block, *arguments, executor, progress)
    free = _Free.of(*arguments)
    if free is not None:
        return [free.run(range(len(starts)), *arguments[1:], threads or 0, progress)]
    if (threads or 1) == 1:
        return _blocks(run_each, *arguments, None, progress)
    with ThreadPoolExecutor(threads) as pool:
        return _blocks(run_each, *arguments, pool, progress)


def _joined(found, kind, starts, samples, columns):
    count = len(starts)
    width = max([starts.shape[1], *(block.rows["x"].shape[1] for block in found)])
    rows = empty_rows(count, width)
    states = None if samples is None else np.full((count, samples.size, width), np.nan)
    begin = 0
    for block in found:
        end, narrow = begin + len(block.rows), block.rows["x"].shape[1]
        for name in rows.dtype.names:
            if name != "x":
                rows[name][begin:end] = block.rows[name]
        rows["x"][begin:end, :narrow] = block.rows["x"]
        if states is not None:
            states[begin:end, :, :narrow] = block.states
        begin = end
    named = next((block for block in found if block.guard_names is not None), _Block(guard_names=[]))
    return dict(rows=rows, complete=begin == count and all(block.complete for block in found),
                inputs=columns.inputs(), times=samples, states=states,
                failures={row: said for block in found for row, said in block.failures.items()},
                event_table=None if kind is None else _event_table(found, kind, width),
                guard_names=named.guard_names, modes=named.modes)
