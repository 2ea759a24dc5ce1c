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
"""

import json
import struct
import sys

import torch


def export(path, network, about, features):
    linear = [layer for layer in network if isinstance(layer, torch.nn.Linear)]
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
