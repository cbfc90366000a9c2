"""Foreign text: nothing in it controls a terminal, and no secret of the environment is in it."""

from __future__ import annotations

import io
from pathlib import Path

import joshua
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua.ipc import messages as ipc
from joshua.plan.foreign_text import SafeStream, has_token, masked, printable, raw

SECRETS = {
    "HF_TOKEN": "hf_0123456789abcdef",
    "WANDB_API_KEY": "0a1b2c3d4e5f60718293a4b5c6d7e8f901234567",
    "AWS_SECRET_ACCESS_KEY": "wJalrXUtnFEMI/K7MDENG/bPxRfiCYEXAMPLEKEY",
    "AWS_SESSION_TOKEN": "FwoGZXIvYXdzEBYaDH",
    "MLFLOW_TRACKING_PASSWORD": "open sesame",
    "PGPASSWORD": "tiger",
    "MY_PASSPHRASE": "correct horse",
}


@given(st.text())
def test_printable_text_holds_no_control_character(text: str) -> None:
    found = printable(text)
    assert all(character.isprintable() or character in "\t\n" or ord(character) > 159 for character in found)
    assert not set(found) & {"\x1b", "\x9b", "\r", "\x07", "\x7f", "\u202e", "\u2066"}
    found.encode()


def test_text_becomes_printable_and_is_cut() -> None:
    assert printable("a\udc80b") == "a\\udc80b"
    assert printable("é\t1\n2 ⡇") == "é\t1\n2 ⡇"
    assert printable("\x1b[2J\r\x9b1m\u202e") == "\\x1b[2J\\x0d\\x9b1m\\u202e"
    assert printable("x" * 12, 10) == "x" * 10 + "… (2 more characters)"
    ipc.encode(ipc.Log(node="/a", time_ns=1, level=30, text=printable("\ud800")))


def test_text_is_cut_after_its_secrets_are_masked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_TOKEN", "hf_0123456789abcdef")
    assert printable("token hf_0123456789abcdef refused", 10) == "token (hid… (12 more characters)"


@pytest.mark.parametrize("name", SECRETS)
def test_values_of_secret_variables_are_masked(name: str) -> None:
    value = SECRETS[name]
    assert masked(f"refused: {value}, says the server", SECRETS) == "refused: (hidden), says the server"


def test_short_secrets_are_masked_as_words_only() -> None:
    assert masked("tiger and tigers", SECRETS) == "(hidden) and tigers"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(
            ("TOKENIZERS_PARALLELISM", "false"),
            ("USE_TOKEN", "true"),
            ("KEYBOARD", "us-layout"),
            ("HOME", "/root"),
        ),
        *(("GOOGLE_APPLICATION_CREDENTIALS", "/home/user/key.json"), ("MAX_TOKENS", "4096"), ("API_KEY", "")),
        *(("MONKEY", "bananas are fine"), ("HF_TOKEN_PATH", "~/.cache/token")),
    ],
)
def test_other_variables_are_not_masked(name: str, value: str) -> None:
    text = f"{name} is {value}, true or false"
    assert masked(text, {name: value}) == text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("http://me:pass@server:5000/api failed", "http://(hidden)@server:5000/api failed"),
        (
            "GET https://x.org/a?X-Amz-Signature=abc123&b=2",
            "GET https://x.org/a?X-Amz-Signature=(hidden)&b=2",
        ),
        ("https://x.org/a?episode=3#top", "https://x.org/a?episode=3#top"),
        ("Authorization: Bearer abcdef012345", "Authorization: Bearer (hidden)"),
        ("key AKIAIOSFODNN7EXAMPLE used", "key (hidden) used"),
        ("ghp_0123456789abcdef0123", "(hidden)"),
        ("hf_abcdefghijkl", "(hidden)"),
        ("udp://192.168.1.2:7447 is a locator", "udp://192.168.1.2:7447 is a locator"),
        ("high ghosts and basic asics", "high ghosts and basic asics"),
    ],
)
def test_tokens_and_passwords_are_masked_wherever_they_come_from(text: str, expected: str) -> None:
    assert masked(text, {}) == expected


def test_tokens_are_found() -> None:
    assert has_token("s3://key:secret@bucket")
    assert has_token("hf_abcdefghijkl")
    assert not has_token("s3://bucket/folder")


def test_a_stream_makes_all_that_is_written_printable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WANDB_API_KEY", "0a1b2c3d4e5f6071")
    kept = io.StringIO()
    stream = SafeStream(kept)
    print("evil\x1b]0;title\x07.pbtxt", file=stream)
    stream.writelines(["a\x9b2J\n", "key 0a1b2c3d4e5f6071\n"])
    stream.flush()
    assert kept.getvalue() == "evil\\x1b]0;title\\x07.pbtxt\na\\x9b2J\nkey (hidden)\n"
    kept.truncate(0)
    kept.seek(0)
    raw(stream).write("\x1b[31m0a1b2c3d4e5f6071\x1b[0m")  # type: ignore[arg-type]
    assert kept.getvalue() == "\x1b[31m(hidden)\x1b[0m"
    assert not stream.isatty()


#: Modules that draw on a terminal: all that they draw is made printable first.
DRAWING = {
    *("cli/commands/status.py", "config/diagnostics.py", "supervisor/tables.py", "supervisor/terminal.py"),
    *("supervisor/terminal_guard.py", "tools/keys.py"),
}


def test_only_these_modules_send_control_sequences() -> None:
    source = Path(joshua.__file__).parent
    found = {
        path.relative_to(source).as_posix()
        for path in source.rglob("*.py")
        if "\\x1b" in path.read_text(encoding="utf-8") and "_pb2" not in path.name
    }
    assert found == DRAWING
