#!/usr/bin/env python3
"""Says what a change has moved in the runs of the golden test.

    RICOCHET_WRITE_EVENTS=old.txt golden_tests    before the change, and new.txt after it
    tests/golden/moved.py old.txt new.txt

One line for each run that differs: whether its events are the same in number and order, by how much
an event time has moved at most, and the end of the run, relative to 1 + |x|. Exit status 1 where the
events of a run differ in number or order.
"""
import sys


def read(path):
    runs = {}
    for line in open(path):
        if line.startswith("  end "):
            t, outcome, *x = line.split()[1:]
            run["end"] = (outcome, [float(t)] + [float(each) for each in x])
        elif line.startswith("  "):
            t, *what, slope = line.split()
            run["events"].append((float(t), what, float(slope)))
        else:
            run = runs.setdefault(line.strip(), {"events": [], "end": None})
    return runs


def apart(a, b):
    return 0 if a == b or a != a and b != b else abs(a - b)


def main():
    old, new = (read(path) for path in sys.argv[1:3])
    status = 0
    for name in old.keys() | new.keys():
        if name not in old or name not in new:
            print(f"only in one file: {name}")
            status = 1
    for name in old:
        a, b = old[name], new.get(name)
        if b is None or a == b:
            continue
        same = [what for _, what, _ in a["events"]] == [what for _, what, _ in b["events"]]
        same = same and a["end"][0] == b["end"][0]
        times = max((apart(x[0], y[0]) for x, y in zip(a["events"], b["events"])), default=0)
        end = max(apart(x, y) / (1 + abs(x)) for x, y in zip(a["end"][1], b["end"][1]))
        status = status if same else 1
        print(f"{'same' if same else 'DIFFER':6} {len(a['events']):5} events, "
              f"times within {times:.1e} s, end within {end:.1e}: {name}")
    return status


if __name__ == "__main__":
    sys.exit(main())
