"""Runs of hybrid systems as functions of PyTorch, with gradients through events.

``import ricochet.torch`` needs PyTorch. A system's functions may call networks of PyTorch: those are
evaluated without Python, and the gradient goes to their weights::

    net = torch.nn.Sequential(torch.nn.Linear(2, 32), torch.nn.Tanh(), torch.nn.Linear(32, 1)).double()
    a = ricochet.torch.network(net)
    system = ricochet.System(lambda t, x: [x[1], a(x[0], x[1]) - 9.8], ...)
    out = ricochet.torch.run(system, x0, t_end, sample_times=times)
    ((out.samples[:, 0] - data) ** 2).sum().backward()
"""

from typing import Any, NamedTuple

import numpy as np
import torch

from ._gradient import Perceptron, _recording_of, adjoint


class Result(NamedTuple):
    """Tensors of a run, with gradients; ``run`` is the `ricochet.Adjoint` itself.

    ``x`` is the state at the end and ``samples`` has a row for each sample time, at their fixed
    times; ``event_times``, ``before`` and ``after`` are those of the events, and move with them.
    Gradients through a grazing event, or through events whose order matters, are NaN:
    ``run.undefined_at`` names it.
    """

    x: torch.Tensor
    samples: torch.Tensor
    event_times: torch.Tensor
    before: torch.Tensor
    after: torch.Tensor
    run: Any


class _ModulePerceptron(Perceptron):
    """A network whose weights are read from a module at every run."""

    def __init__(self, module):
        linear, activation = _layers_of(module)
        super().__init__([(each.weight.detach().double().cpu().numpy(),
                           each.bias.detach().double().cpu().numpy()) for each in linear],
                         activation)
        self.module, self._linear = module, linear

    def flat(self):
        """The weights as one tensor, on the graph of the module."""
        return torch.cat([part.reshape(-1).double() for each in self._linear
                          for part in (each.weight, each.bias)])


def _layers_of(module):
    linear, activations = [], set()
    children = list(module.children()) if isinstance(module, torch.nn.Sequential) else [module]
    expects_linear = True
    for child in children:
        if isinstance(child, torch.nn.Linear) is not expects_linear:
            break
        if expects_linear:
            if child.bias is None:
                break
            linear.append(child)
        elif isinstance(child, (torch.nn.Tanh, torch.nn.ReLU)):
            activations.add("tanh" if isinstance(child, torch.nn.Tanh) else "relu")
        else:
            break
        expects_linear = not expects_linear
    else:
        if linear and not expects_linear and len(activations) < 2:
            return linear, activations.pop() if activations else "tanh"
    raise TypeError(f"network: found {module}, expected a torch.nn.Sequential of Linear layers with "
                    "biases, with Tanh or ReLU, the same throughout, between them")


def network(module):
    """A network that the functions of a system may call, by an ``nn.Sequential`` of Linear layers
    with Tanh or ReLU between them. Its weights are read, by value, at every `run`."""
    return _ModulePerceptron(module)


class _Run(torch.autograd.Function):
    @staticmethod
    def forward(ctx, call, x0, args, *networks):
        run = call(x0.detach().double().cpu().numpy(), args.detach().double().cpu().numpy(),
                   [each.detach().cpu().numpy() for each in networks])
        ctx.run, ctx.like = run, (x0, args)
        call.run = run
        return tuple(torch.as_tensor(np.ascontiguousarray(each), device=x0.device) for each in (
            run.x, run.samples, run.event_times, run.before, run.after))

    @staticmethod
    def backward(ctx, x, samples, event_times, before, after):
        def given(tensor):
            if tensor is None or tensor.numel() == 0 or not bool((tensor != 0).any()):
                return None
            return tensor.double().cpu().numpy()
        by = ctx.run.gradient(end=given(x), samples=given(samples), event_times=given(event_times),
                              before=given(before), after=given(after))
        x0, args = ctx.like
        by_args = None
        if args.numel():  # those of a ready system are its parameters
            by_args = torch.as_tensor(by.args).to(args).reshape(args.shape)
        return (None, torch.as_tensor(by.x0).to(x0).reshape(x0.shape), by_args,
                *(torch.as_tensor(each, device=x0.device) for each in by.networks))


class _Call:
    """A run with all but the numbers of its tensors."""

    def __init__(self, system, t_end, options):
        self.system, self.t_end, self.options = system, t_end, options
        self.run = None

    def __call__(self, x0, args, networks):
        return adjoint(self.system, x0, self.t_end, args=() if self.options["ready"] else args,
                       networks=networks, **self.options["given"])


def run(system, x0, t_end, *, args=(), **options):
    """Runs a system, and returns its numbers as tensors with gradients: a `Result`.

    ``x0`` and ``args`` may be tensors; the other arguments are those of `ricochet.adjoint`. The
    numbers are float64, whatever the tensors are.
    """
    x0 = torch.atleast_1d(torch.as_tensor(x0, dtype=None if torch.is_tensor(x0) else torch.float64))
    if not torch.is_tensor(args):
        args = torch.stack([torch.as_tensor(each, dtype=torch.float64) for each in args]) if len(
            args) else torch.zeros(0, dtype=torch.float64)
    ready = not hasattr(system, "_guard_list")
    recording, _ = _recording_of(system, x0.numel(), () if ready else args.detach().cpu().numpy())
    tensors = [each.flat() if isinstance(each, _ModulePerceptron)
               else torch.as_tensor(each.parameters) for each in recording.networks]
    call = _Call(system, t_end, dict(ready=ready, given=options))
    out = _Run.apply(call, x0, args, *tensors)
    return Result(*out, call.run)
