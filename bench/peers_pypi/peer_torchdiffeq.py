"""torchdiffeq on PyTorch: `odeint_event`, a run for each impact, and its gradient by backpropagation."""
import sys

import torch
from torchdiffeq import odeint_event

import problems
from cell import events, main, values, version

torch.set_default_dtype(torch.float64)
torch.set_num_threads(1)


def times_of(height, gravity, restitution, tolerance):
    """The times of the impacts, as in the manual's own example of a ball, from just above the floor."""
    def falls(t, y):
        return y[1], -gravity * torch.ones_like(y[1])

    def floor(t, y):
        return y[0]

    t, y, times = torch.zeros(1), (height.reshape(1), torch.zeros(1)), []
    for _ in range(problems.IMPACTS):
        t, states = odeint_event(falls, y, t, event_fn=floor, rtol=tolerance, atol=tolerance)
        times.append(t)
        y = (states[0][-1] + 1e-7, -restitution * states[1][-1])
    return times


def parameters(with_gradient):
    numbers = (problems.HEIGHT, problems.GRAVITY, problems.RESTITUTION)
    return [torch.tensor(number, requires_grad=with_gradient) for number in numbers]


def ball(tolerance):
    def make():
        def solve():
            with torch.no_grad():
                return times_of(*parameters(False), tolerance)
        return solve, lambda times: events(float(t) for t in times)
    return make


def gradient(tolerance):
    def make():
        def solve():
            by = parameters(True)
            times_of(*by, tolerance)[-1].sum().backward()
            return by
        return solve, lambda by: values(float(x.grad) for x in by)
    return make


def cells():
    return [row for tolerance in (1e-8, 1e-12)
            for row in (("ball", "torchdiffeq", "odeint_event, dopri5", tolerance, ball(tolerance)),
                        ("gradient", "torchdiffeq", "odeint_event, backward", tolerance, gradient(tolerance)))]


if __name__ == "__main__":
    sys.exit(main({"torchdiffeq": version("torchdiffeq"), "PyTorch": version("torch")}, cells()))
