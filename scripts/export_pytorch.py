#!/usr/bin/env python3
"""Export a PyTorch MLP to a model file that ricochet loads.

`export` is all there is to it: a dozen lines that need torch, json and struct, to
be copied into a training script. Run alone, this file writes an untrained network,
seeded, in float32 or float64, so that the export can be tried:

    export_pytorch.py untrained.safetensors [float64]

`network` is a torch.nn.Sequential of Linear layers with ReLU or Tanh between them.
`about` holds the strings that nn/model.hpp lists, all but those which
`export` adds: numbers in decimal, lists separated by blanks. `features` is one raw
sample, recorded with the logits that PyTorch computes from it and computed again at
every load: a layer transposed, an activation or a scale forgotten, and the file is
refused.

`export_guard` writes a network that is a guard (nn/guard_network.hpp): a Sequential of
Linear layers with the same ReLU, Tanh, Softplus, SiLU, or module named Sin or Sine after
each but the last. A module named Residual in it holds a Linear layer and its activation,
as a Sequential or as its children in this order, and returns x + activation(linear(x)).
"""

import json
import struct
import sys

import torch


def export(path, network, about, features, linear=None):
    linear = linear or [layer for layer in network if isinstance(layer, torch.nn.Linear)]
    text = lambda numbers: " ".join(map(repr, numbers))  # shortest decimals that read back the same
    given = zip(features, *([float(word) for word in about[key].split()] for key in ("offset", "scale")))
    x = torch.tensor([(value - offset) * scale for value, offset, scale in given], dtype=linear[0].weight.dtype)
    test = {"self_test_input": text(features), "self_test_output": text(network(x).tolist())}
    header, data = {"__metadata__": {"ricochet": "1", **about, **test}}, b""
    for name, tensor in torch.nn.ModuleList(linear).state_dict(prefix="layers.").items():
        dtype, code = {torch.float32: ("F32", "f"), torch.float64: ("F64", "d")}[tensor.dtype]
        begin, data = len(data), data + struct.pack(f"<{tensor.numel()}{code}", *tensor.flatten().tolist())
        header[name] = {"dtype": dtype, "shape": list(tensor.shape), "data_offsets": [begin, len(data)]}
    with open(path, "wb") as file:
        file.write(struct.pack("<Q", len(json.dumps(header))) + json.dumps(header).encode() + data)


ACTIVATIONS = {"ReLU": "relu", "Tanh": "tanh", "Softplus": "softplus", "SiLU": "silu", "Sin": "sin", "Sine": "sin"}


def layers_of(network):
    """The Linear layers of a guard, its activation, and the numbers of its residual layers."""
    linear, found, residual = [], set(), []
    expects_activation = False

    def refuse(what):
        raise ValueError(f"export_guard: {what}")

    def visit(module):
        nonlocal expects_activation
        kind = type(module).__name__
        if kind == "Linear":
            if expects_activation:
                refuse(f"expected an activation before Linear layer {len(linear)}")
            linear.append(module)
            expects_activation = True
        elif kind in ACTIVATIONS:
            if not expects_activation:
                refuse(f"expected a Linear layer before {kind}")
            if kind == "Softplus" and (module.beta != 1 or module.threshold < 20):
                refuse(f"expected Softplus of beta 1, found beta {module.beta}, threshold {module.threshold}")
            found.add(ACTIVATIONS[kind])
            expects_activation = False
        elif kind in ("Sequential", "Residual"):
            first = len(linear)
            for child in module.children():
                visit(child)
            if kind == "Residual":
                if len(linear) != first + 1 or expects_activation:
                    refuse("expected one Linear layer and its activation in a Residual")
                residual.append(first)
        else:
            refuse(f"expected Linear, Residual or one of {', '.join(ACTIVATIONS)}, found {kind}")

    visit(network)
    if not linear or not expects_activation:
        refuse("expected a Linear layer at the end")
    if len(found) > 1:
        refuse(f"expected the same activation after each layer, found {' and '.join(sorted(found))}")
    return linear, found.pop() if found else "relu", residual


def export_guard(path, network, features, offset=None, scale=None, domain=None, system="", seed=0):
    """Writes a guard. It is evaluated at (features - offset) scale, by default of 0 and 1; `domain`
    holds lower and upper bounds for each feature, by default none."""
    linear, activation, residual = layers_of(network)
    inputs = len(features)
    text = lambda numbers: " ".join(map(repr, map(float, numbers)))
    about = {
        "kind": "guard",
        "system": system,
        "parameters": "",
        "recipe": "state",
        "offset": text(offset or [0.0] * inputs),
        "scale": text(scale or [1.0] * inputs),
        "domain": text(domain) if domain else " ".join(["-inf inf"] * inputs),
        "activation": activation,
        "threshold": "0",
        "step_range": "0 0",
        "seed": str(seed),
    }
    if residual:
        about["residual"] = " ".join(map(str, residual))
    export(path, network, about, features, linear)


if __name__ == "__main__":
    torch.manual_seed(1)
    layers = [torch.nn.Linear(2, 8), torch.nn.ReLU(), torch.nn.Linear(8, 8), torch.nn.ReLU(), torch.nn.Linear(8, 1)]
    network = torch.nn.Sequential(*layers).to(getattr(torch, (sys.argv + ["float32"])[2]))
    about = {
        "kind": "event-classifier",
        "system": "bouncing-ball",
        "parameters": "gravity=9.81 restitution=0.8",
        "recipe": "state",
        "offset": "0.5 0",
        "scale": "2 0.25",
        "domain": "0 1 -5 5",
        "activation": "relu",
        "threshold": "0",
        "step_range": "0.001 0.01",
        "seed": "1",
    }
    export(sys.argv[1], network, about, [0.75, -1.5])
