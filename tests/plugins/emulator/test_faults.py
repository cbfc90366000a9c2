import pytest
from joshua_emulator.cli import parse_fault
from joshua_emulator.control import ControlError
from joshua_emulator.faults import FaultError, Faults


def test_without_faults_nothing_is_disturbed() -> None:
    faults = Faults()
    assert all(faults.disturb(b"abc") == (b"abc", 0.0) for _ in range(100))
    assert not any(faults.loses_request() for _ in range(100))


def test_faults_come_at_their_rate_and_are_counted() -> None:
    faults = Faults(seed=3)
    faults.set({"drop": 0.1, "corrupt": 0.2, "late": 0.3, "late_by_s": 0.5})
    results = [faults.disturb(b"abcdef") for _ in range(2000)]
    kept = [result for result in results if result is not None]
    assert 120 < len(results) - len(kept) == faults.counts["drop"] < 280
    assert 280 < sum(data != b"abcdef" for data, _ in kept) == faults.counts["corrupt"] < 480
    assert {late_s for _, late_s in kept} == {0.0, 0.5}
    assert all(
        bin(int.from_bytes(data, "big") ^ int.from_bytes(b"abcdef", "big")).count("1") <= 1
        for data, _ in kept
    )


def test_a_seed_repeats_the_faults() -> None:
    def draw() -> list[bool]:
        faults = Faults(seed=7)
        faults.set({"drop": 0.5})
        return [faults.disturb(b"x") is None for _ in range(50)]

    assert draw() == draw()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"lost": 0.1}, "unknown line fault 'lost'; allowed: drop, drop_request, corrupt, late, late_by_s"),
        ({"drop": 1.5}, "drop is 1.5; allowed: a probability from 0 to 1"),
        ({"drop": float("nan")}, "drop is nan"),
        ({"late_by_s": "soon"}, "late_by_s is 'soon'; allowed: seconds"),
    ],
)
def test_wrong_faults_are_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(FaultError, match=message.replace("(", r"\(")):
        Faults().set(values)


def test_a_fault_is_read_from_the_command_line() -> None:
    assert parse_fault("unplug,at_s=5,name=ttyACM3") == {"kind": "unplug", "at_s": 5, "name": "ttyACM3"}
    assert parse_fault("late=0.01,late_by_s=0.03") == {"kind": "late", "value": 0.01, "late_by_s": 0.03}
    with pytest.raises(ControlError, match="needs a value, as in at_s=5"):
        parse_fault("unplug,soon")
