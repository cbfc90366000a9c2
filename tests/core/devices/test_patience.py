from joshua.devices.patience import Patience


def test_a_silence_is_borne_up_to_its_limit() -> None:
    patience = Patience(0.3)
    assert patience.miss(10.0, 10.1)
    for number in range(4):
        assert patience.miss(10.1 + 0.04 * number, 10.12 + 0.04 * number)
    assert not patience.miss(10.28, 10.3)
    assert patience.missed == 6


def test_a_driver_that_is_held_up_itself_gets_its_readings() -> None:
    patience = Patience(0.3)
    for number in range(4):
        assert patience.miss(10.0 + 0.2 * number, 10.1 + 0.2 * number), "few readings in much time"
    assert not patience.miss(10.8, 10.9)


def test_an_answer_ends_a_silence_and_says_how_long_it_was() -> None:
    patience = Patience(0.3)
    assert patience.hear(9.0) == 0.0
    patience.miss(10.0, 10.1)
    assert patience.hear(10.12) - 0.12 < 1e-9
    assert patience.miss(10.15, 10.4), "a new silence, a new limit"
    assert 0.11 < patience.longest_s < 0.13


def test_a_slow_loop_reads_at_least_twice() -> None:
    patience = Patience(0.3)
    assert patience.miss(10.0, 10.1)
    assert not patience.miss(11.0, 11.1)
