"""Writes an exported policy, without PyTorch: a network of two inputs whose weights are in this file."""

from __future__ import annotations

import base64
import json
from pathlib import Path

from checkpoints import write_checkpoint

#: Six joints and a picture of 64 × 48 in; a chunk of two steps out: the joints plus the mean of the picture
#: / 2550, and half of that. Made by ``torch.onnx.export``.
NETWORK = base64.b64decode(
    "CAgSB3B5dG9yY2gaBjIuMTMuMDr0BwpAChZvYnNlcnZhdGlvbi5pbWFnZXMudG9wEg4vQ2FzdF9vdXRwdXRfMBoFL0Nhc3QiBENh"
    "c3QqCQoCdG8YAaABAgpQCg4vQ2FzdF9vdXRwdXRfMBIUL1JlZHVjZU1lYW5fb3V0cHV0XzAaCy9SZWR1Y2VNZWFuIgpSZWR1Y2VN"
    "ZWFuKg8KCGtlZXBkaW1zGACgAQIKPxISL0NvbnN0YW50X291dHB1dF8wGgkvQ29uc3RhbnQiCENvbnN0YW50KhQKBXZhbHVlKggQ"
    "AUoEAGAfRaABBApEChQvUmVkdWNlTWVhbl9vdXRwdXRfMAoSL0NvbnN0YW50X291dHB1dF8wEg0vRGl2X291dHB1dF8wGgQvRGl2"
    "IgNEaXYKPAoRb2JzZXJ2YXRpb24uc3RhdGUKDS9EaXZfb3V0cHV0XzASDS9BZGRfb3V0cHV0XzAaBC9BZGQiA0FkZApDEhQvQ29u"
    "c3RhbnRfMV9vdXRwdXRfMBoLL0NvbnN0YW50XzEiCENvbnN0YW50KhQKBXZhbHVlKggQAUoEAAAAP6ABBAo/Cg0vQWRkX291dHB1"
    "dF8wChQvQ29uc3RhbnRfMV9vdXRwdXRfMBINL011bF9vdXRwdXRfMBoEL011bCIDTXVsCkkSFC9Db25zdGFudF8yX291dHB1dF8w"
    "GgsvQ29uc3RhbnRfMiIIQ29uc3RhbnQqGgoFdmFsdWUqDggBEAdKCAEAAAAAAAAAoAEEClEKDS9BZGRfb3V0cHV0XzAKFC9Db25z"
    "dGFudF8yX291dHB1dF8wEhMvVW5zcXVlZXplX291dHB1dF8wGgovVW5zcXVlZXplIglVbnNxdWVlemUKSRIUL0NvbnN0YW50XzNf"
    "b3V0cHV0XzAaCy9Db25zdGFudF8zIghDb25zdGFudCoaCgV2YWx1ZSoOCAEQB0oIAQAAAAAAAACgAQQKVQoNL011bF9vdXRwdXRf"
    "MAoUL0NvbnN0YW50XzNfb3V0cHV0XzASFS9VbnNxdWVlemVfMV9vdXRwdXRfMBoML1Vuc3F1ZWV6ZV8xIglVbnNxdWVlemUKUgoT"
    "L1Vuc3F1ZWV6ZV9vdXRwdXRfMAoVL1Vuc3F1ZWV6ZV8xX291dHB1dF8wEgZhY3Rpb24aBy9Db25jYXQiBkNvbmNhdCoLCgRheGlz"
    "GAGgAQISCm1haW5fZ3JhcGhaIwoRb2JzZXJ2YXRpb24uc3RhdGUSDgoMCAESCAoCCAEKAggGWjAKFm9ic2VydmF0aW9uLmltYWdl"
    "cy50b3ASFgoUCAISEAoCCAEKAggwCgIIQAoCCANiHAoGYWN0aW9uEhIKEAgBEgwKAggBCgIIAgoCCAZCAhAR"
)


def write_exported(folder: Path, network: bytes = NETWORK, *, radians: bool = True) -> Path:
    """A folder as ``joshua policy export`` writes it."""
    reach = 1.5 if radians else 90.0
    write_checkpoint(folder, least=-reach, greatest=reach, n_action_steps=2, chunk_size=2)
    (folder / "model.safetensors").unlink()
    (folder / "policy.onnx").write_bytes(network)
    path = folder / "config.json"
    described = {"onnx": {"bytes": len(network), "exported_from": "act"}}
    path.write_text(json.dumps(json.loads(path.read_text()) | described))
    return folder
