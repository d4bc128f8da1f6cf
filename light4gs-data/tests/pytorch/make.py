"""Writes the files of this folder with PyTorch itself (1.13, Debian 12's python3-torch); the test has the same numbers."""

import os
import pickle
from collections import OrderedDict

import torch

torch.manual_seed(0)
module = torch.nn.Sequential(torch.nn.Linear(3, 2), torch.nn.ReLU(), torch.nn.BatchNorm1d(2))
with torch.no_grad():
    module[0].weight.copy_(torch.arange(6.0).reshape(2, 3) / 4)
    module[0].bias.copy_(torch.tensor([-1.0, 0.5]))
base = torch.arange(12.0).reshape(3, 4)
tensors = OrderedDict(
    state=module.state_dict(),
    parameter=torch.nn.Parameter(torch.tensor([1.5, -2.5])),
    transposed=base.T,
    row=base[1],
    half=torch.tensor([0.5, -3.0], dtype=torch.float16),
    brain=torch.tensor([0.5, -3.0], dtype=torch.bfloat16),
    double=torch.tensor([[0.25]], dtype=torch.float64),
    long=torch.tensor([-7, 1 << 20]),
    table=torch.tensor([True, False, True]),
    scalar=torch.tensor(4.0),
    empty=torch.zeros(0, 5),
    settings={"name": "x", "rate": 0.5, "steps": [1, 2], "none": None},
)
torch.save(tensors, "zip.pth")
torch.save(tensors, "legacy.pth", _use_new_zipfile_serialization=False)
torch.save(torch.tensor([True, True, False]), "tensor.pth")


class Attack:
    def __reduce__(self):
        return os.system, ("touch /tmp/light4gs-was-attacked",)


torch.save({"weight": torch.zeros(2), "x": Attack()}, "attack.pth")
torch.save({"weight": torch.zeros(2), "x": Attack()}, "attack_legacy.pth", _use_new_zipfile_serialization=False)
torch.save(module, "module.pth")
with open("foreign.pth", "wb") as file:
    pickle.dump({"weight": [1.0, 2.0]}, file, protocol=2)
