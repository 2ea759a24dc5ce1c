#!/usr/bin/env python3
"""Times of gradients through events from Python: the ball's 13 impacts, and where PyTorch is found a system whose
flow, guard and reset are networks.

usage: PYTHONPATH=build/release/python bench/gradients_bench.py

Times are processor times, their medians; each gradient is compared with a closed form or with differences first.
"""

import time

import numpy as np

import ricochet


def median(work, repetitions=300):
    """Milliseconds."""
    taken = []
    for _ in range(repetitions):
        start = time.process_time()
        work()
        taken.append(time.process_time() - start)
    return 1e3 * np.median(taken)


def ball():
    system = ricochet.BouncingBall()

    def work():
        return ricochet.gradient(lambda run: run.event_times[12], system, [10.0, 0.0], 20.5, rtol=1e-10, atol=1e-10)
    t1 = np.sqrt(20 / 9.81)
    t13 = t1 * (1 + 2 * sum(0.9**k for k in range(1, 13)))
    exact = [t13 / 20, -t13 / (2 * 9.81), 2 * t1 * sum(k * 0.9**(k - 1) for k in range(1, 13))]
    found = work()
    error = np.max(np.abs(np.array([found.x0[0], *found.args]) / exact - 1))
    print(f"ball, time of impact 13 by start and parameters: {median(work):.3f} ms, "
          f"error {error:.1e} of the closed form")


def networks():
    try:
        import torch
    except ImportError:
        print("PyTorch was not found")
        return
    import ricochet.torch
    torch.set_num_threads(1)
    torch.manual_seed(3)

    def network(inputs, width):
        module = torch.nn.Sequential(torch.nn.Linear(inputs, width), torch.nn.Tanh(), torch.nn.Linear(width, width),
                                     torch.nn.Tanh(), torch.nn.Linear(width, 1)).double()
        for part in module.parameters():
            torch.nn.init.normal_(part, 0, 0.15)
        return module
    modules = [network(2, 32), network(2, 32), network(1, 16)]
    a, g, r = map(ricochet.torch.network, modules)
    system = ricochet.System(
        lambda t, x: [x[1], -9.8 + a(x[0], x[1])],
        [ricochet.Guard(lambda t, x: x[0] + g(x[0], x[1]), name="floor",
                        reset=lambda t, x: [x[0], -x[1] / (1 + np.exp(-r(x[1])))])])
    times = [0.15 * k for k in range(1, 41)]
    data = torch.tensor([3 + np.sin(k) for k in range(1, 41)], dtype=torch.float64)
    parts = [part for module in modules for part in module.parameters()]

    def loss(**tolerances):
        out = ricochet.torch.run(system, [10.0, 0.0], 6.0, sample_times=times, **tolerances)
        return ((out.samples[:, 0] - data) ** 2).sum(), out.run

    def work():
        for part in parts:
            part.grad = None
        value, run = loss()
        value.backward()
        return run
    run = work()
    directions = [torch.randn_like(part) for part in parts]
    size = float(sum((each**2).sum() for each in directions)) ** 0.5
    along = sum(float((each * part.grad).sum()) for each, part in zip(directions, parts)) / size

    def moved(h):
        with torch.no_grad():
            for each, part in zip(directions, parts):
                part.add_(each, alpha=h / size)
            value = float(loss(rtol=1e-12, atol=1e-12)[0])
            for each, part in zip(directions, parts):
                part.sub_(each, alpha=h / size)
        return value
    h = 1e-4
    difference = (8 * (moved(h) - moved(-h)) - moved(2 * h) + moved(-2 * h)) / (12 * h)
    print(f"PyTorch, {sum(part.numel() for part in parts)} weights, {len(run.event_times)} events, {run.steps} steps: "
          f"value and gradient {median(work):.2f} ms, error {abs(along / difference - 1):.1e} of differences")


if __name__ == "__main__":
    ball()
    networks()
