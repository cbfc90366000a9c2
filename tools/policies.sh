#!/bin/sh
# Makes an environment that trains, evaluates and runs policies: PyTorch and LeRobot in versions that were tested together on
# Python 3.11, the simulator, and the plugins of this clone. Usage: tools/policies.sh FOLDER [words for pip's installation of torch]
# For example a build without CUDA: tools/policies.sh policies --index-url ADDRESS
# Then name it in the node of the model: python: "FOLDER/bin/python"
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
fail() {
    code=$1 && shift
    printf 'policies.sh: %s\n' "$1" >&2
    shift
    for line in "$@"; do printf '  %s\n' "$line" >&2; done
    exit "$code"
}
if [ $# -lt 1 ] || [ "${1#-}" != "$1" ]; then
    fail 2 'name the folder of the environment' 'next: tools/policies.sh policies'
fi
folder=$1 && shift
python=${PYTHON:-python3.11}
command -v "$python" >/dev/null 2>&1 ||
    fail 3 "$python is not installed, and the versions were tested on Python 3.11" \
        "next: install it, or try another one: PYTHON=python3.12 $0 $folder"
printf 'pip downloads PyTorch and LeRobot: 1 GB for a processor, up to 9 GB for CUDA …\n' >&2
"$python" -m venv "$folder" || fail 3 "the environment $folder cannot be made; the reason stands above"
# torch, torchvision and torchcodec are compiled against each other, so one call of pip chooses all three builds.
torch=$(sed -n 's/.*pip install \(torch==[^&]*\) &&.*/\1/p' "$root/constraints-learn.txt")
# shellcheck disable=SC2086 # three words
"$folder/bin/python" -m pip install --quiet $torch "$@" ||
    fail 3 "pip cannot install $torch $*; its reason stands above" \
        "next: correct the words after the folder, then run $0 $folder again"
"$folder/bin/python" -m pip install --quiet --no-deps -r "$root/constraints-learn.txt" ||
    fail 3 'pip cannot install LeRobot and what it needs; its reason stands above' "next: run $0 $folder again"
set --
for plugin in calibration dataset evaluation imitation inference jobs lerobot mujoco-sim onnx ppo-trainer ray services smolvla teleop-input training; do
    set -- "$@" -e "$root/joshua-plugins/$plugin"
done
"$folder/bin/python" -m pip install --quiet --no-deps -e "$root/joshua-core" "$@" ||
    fail 3 'pip cannot install the plugins of this clone; its reason stands above' "next: run $0 $folder again"
"$folder/bin/python" "$root/tools/check_policies.py" ||
    fail 3 "$folder was made, but it cannot run policies; the reason stands above"
printf 'python: "%s/bin/python" in the node of a model runs it there\n' "$(cd "$folder" && pwd)" >&2
