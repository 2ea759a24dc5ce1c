"""Runs as functions of PyTorch."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("ricochet._gradients", reason="the package was built without gradients")

import ricochet  # noqa: E402
import ricochet.torch as rt  # noqa: E402

torch.set_num_threads(1)


def sequential(inputs, seed):
    torch.manual_seed(seed)
    return torch.nn.Sequential(torch.nn.Linear(inputs, 8), torch.nn.Tanh(), torch.nn.Linear(8, 1)).double()


def test_gradcheck_of_start_arguments_and_weights():
    flow, kept = sequential(2, 1), sequential(1, 2)
    a, r = rt.network(flow), rt.network(kept)
    system = ricochet.System(
        lambda t, x, g: [x[1], a(x[0], x[1]) - g],
        [ricochet.Guard(lambda t, x, g: x[0], name="floor",
                        reset=lambda t, x, g: [0, -x[1] / (1 + np.exp(-r(x[1])))])])
    weights = [*flow.parameters(), *kept.parameters()]

    def outputs(x0, args, *_):
        out = rt.run(system, x0, 2.4, args=args, sample_times=[1.0, 2.2], rtol=1e-12, atol=1e-12)
        assert len(out.event_times) == 2
        return out.x, out.samples, out.event_times, out.after
    x0 = torch.tensor([3.0, 0.0], dtype=torch.float64, requires_grad=True)
    args = torch.tensor([9.8], dtype=torch.float64, requires_grad=True)
    # Differences of order two, whose error is 1e-8 here.
    assert torch.autograd.gradcheck(outputs, (x0, args, *weights), eps=1e-5, atol=1e-6)


def test_weights_are_read_at_every_run():
    net = sequential(2, 3)
    a = rt.network(net)
    system = ricochet.System(lambda t, x: [x[1], a(x[0], x[1])])
    first = rt.run(system, [1.0, 0.0], 1.0).x
    with torch.no_grad():
        net[2].bias += 1
    assert not torch.allclose(rt.run(system, [1.0, 0.0], 1.0).x, first)


def test_ready_systems_and_types():
    x0 = torch.tensor([10.0, 0.0], dtype=torch.float32, requires_grad=True)
    out = rt.run(ricochet.BouncingBall(), x0, 5.0)
    out.event_times[0].backward()
    assert x0.grad.dtype == torch.float32
    assert x0.grad[0].item() == pytest.approx(out.event_times[0].item() / 20, rel=1e-6)


def test_a_module_of_another_form_is_refused():
    for module in (torch.nn.Sequential(torch.nn.Linear(2, 2), torch.nn.GELU(), torch.nn.Linear(2, 1)),
                   torch.nn.Sequential(torch.nn.Tanh()), torch.nn.Linear(2, 1, bias=False)):
        with pytest.raises(TypeError, match="expected a torch.nn.Sequential"):
            rt.network(module)
