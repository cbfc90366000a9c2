#!/bin/sh
# Makes an environment that trains, evaluates and runs policies: PyTorch and LeRobot in versions that were tested together on
# Python 3.11, the simulator, and the plugins of this clone. Usage: tools/policies.sh FOLDER [words for pip's installation of torch]
# Then name it in the node of the model: python: "FOLDER/bin/python"
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
if [ $# -lt 1 ] || [ "${1#-}" != "$1" ]; then
    printf 'policies.sh: name the folder of the environment\n  next: tools/policies.sh policies\n' >&2
    exit 2
fi
folder=$1 && shift
python=${PYTHON:-python3.11}
command -v "$python" >/dev/null 2>&1 || {
    printf 'policies.sh: %s is not installed, and the versions were tested on Python 3.11\n' "$python" >&2
    printf '  next: install it, or try another one: PYTHON=python3.12 %s %s\n' "$0" "$folder" >&2
    exit 3
}
printf 'pip downloads PyTorch and LeRobot: 1 GB for a processor, up to 9 GB for CUDA …\n' >&2
"$python" -m venv "$folder"
torch=$(sed -n 's/.*pip install \(torch==[^ ]*\) .*/\1/p' "$root/constraints-learn.txt")
"$folder/bin/python" -m pip install --quiet "$torch" "$@"
"$folder/bin/python" -m pip install --quiet --no-deps -r "$root/constraints-learn.txt"
set --
for plugin in calibration dataset evaluation imitation inference jobs lerobot mujoco-sim onnx ppo-trainer ray smolvla teleop-input training; do
    set -- "$@" -e "$root/joshua-plugins/$plugin"
done
"$folder/bin/python" -m pip install --quiet --no-deps -e "$root/joshua-core" "$@"
printf 'python: "%s/bin/python" in the node of a model runs it there\n' "$(cd "$folder" && pwd)" >&2
