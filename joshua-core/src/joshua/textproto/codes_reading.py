"""Diagnostic codes of reading: files, syntax, names and values, includes, and ``--set``."""

from __future__ import annotations

from joshua.textproto.code_doc import CodeDoc

READING_CODES: dict[str, CodeDoc] = {
    # Files
    "file-missing": CodeDoc(
        "No file stands at the path that was given.",
        "Check the path; `joshua presets` lists files to start from and `joshua new` copies one.",
    ),
    "file-unreadable": CodeDoc(
        "The operating system refuses to open or read the file.",
        "Check the permissions of the file and of the folders above it.",
    ),
    "not-a-file": CodeDoc(
        "The path is a folder, a pipe, a socket or a device; only regular files are read.",
        "Give the path of a configuration file.",
    ),
    "file-too-large": CodeDoc(
        "The file is larger than 8 MiB, or holds more than 500,000 words and signs.",
        "Check that it is a configuration file; split a real one with include.",
    ),
    "not-utf8": CodeDoc(
        "The file holds bytes that are not UTF-8 text.",
        "Save the file as UTF-8.",
    ),
    "nul-byte": CodeDoc(
        "The file holds a NUL byte, which no text editor writes.",
        "Delete the byte; inside a string write it as \\0.",
    ),
    "too-many-problems": CodeDoc(
        "Reading or checking stopped after 1000 problems.",
        "Correct the problems that are shown and run the command again.",
    ),
    # Syntax
    "unexpected-text": CodeDoc(
        "Something stands where a field, such as `name: value` or `name { … }`, was expected.",
        "Delete it, or put a # before it when it is a comment.",
    ),
    "missing-colon": CodeDoc(
        "A colon is missing between the name of a field and its value.",
        "Write `name: value`.",
    ),
    "missing-value": CodeDoc(
        "The name of a field is not followed by a value or a block.",
        "Write `name: value` or `name { … }`, or delete the name.",
    ),
    "missing-brace": CodeDoc(
        "The opening brace of a block is missing.",
        "Write `name {` before the fields of the block.",
    ),
    "missing-comma": CodeDoc(
        "A comma is missing between two entries of a list.",
        "Separate the entries by commas: `[1, 2, 3]`.",
    ),
    "extra-comma": CodeDoc(
        "A comma in a list is not followed by an entry.",
        "Delete the comma.",
    ),
    "unclosed-block": CodeDoc(
        "A block is opened but not closed.",
        "Add the closing brace where the block ends.",
    ),
    "unclosed-list": CodeDoc(
        "A list is opened by [ but not closed.",
        "Add ] after its last entry.",
    ),
    "unclosed-string": CodeDoc(
        "A string has no closing quote on its line.",
        "Add the quote; write a line break inside a string as \\n.",
    ),
    "stray-closer": CodeDoc(
        "A closing bracket stands where no block is open.",
        "Delete it, or add the opening one that it belongs to.",
    ),
    "mismatched-closer": CodeDoc(
        "A block opened by { is closed by > or the other way round.",
        "Use the closing bracket that matches the opening one.",
    ),
    "unquoted-string": CodeDoc(
        "A text value stands without quotes.",
        'Put it in double quotes: "…".',
    ),
    "bad-escape": CodeDoc(
        "A backslash in a string is not followed by one of the escapes that the text format knows.",
        "Write a backslash itself as \\\\.",
    ),
    "bad-type-name": CodeDoc(
        "The type in square brackets is not of the form `[domain/package.Message]`.",
        "Write the type as the plugin documents it, such as `[type.example.org/acme.GripperConfig]`.",
    ),
    "nesting-too-deep": CodeDoc(
        "Blocks are nested more than 100 deep.",
        "Check for braces that are opened and not closed.",
    ),
    # Names and values
    "unknown-field": CodeDoc(
        "The block has no field of this name.",
        "Take one of the names that are allowed there; `joshua explain` lists them.",
    ),
    "wrong-type": CodeDoc(
        "The value is of another type than the field.",
        "Write a value of the field's type.",
    ),
    "number-out-of-range": CodeDoc(
        "The number does not fit the integer type of the field.",
        "Write a number inside the range.",
    ),
    "unknown-enum-value": CodeDoc(
        "The field takes one of a fixed set of names, and this is none of them.",
        "Take one of the names that are allowed.",
    ),
    "unknown-enum-number": CodeDoc(
        "The field takes one of a fixed set of values, and none has this number.",
        "Write the value by its name.",
    ),
    "not-utf8-string": CodeDoc(
        "The escapes of a string make up bytes that are not UTF-8 text.",
        "Write the characters themselves, or as \\u escapes.",
    ),
    "duplicate-field": CodeDoc(
        "A field that holds one value is written twice in one block.",
        "Keep one of the two.",
    ),
    "oneof-conflict": CodeDoc(
        "Two fields are written of which a block may hold only one.",
        "Keep the one that is meant.",
    ),
    "extension-field": CodeDoc(
        "A name in square brackets stands in a block that takes none.",
        "Use it inside a plugin_config block only.",
    ),
    "mixed-any": CodeDoc(
        "A plugin_config block holds more than the one block that gives its type and settings.",
        "Keep one [type] { … } block.",
    ),
    "unknown-plugin-type": CodeDoc(
        "The type of a plugin_config block is not provided by the plugins that are installed.",
        "Take a type that is allowed, or install the plugin that provides it.",
    ),
    "plugin-type-not-installed": CodeDoc(
        "The type of a plugin_config block belongs to a plugin that is not installed, so its settings "
        "are not checked.",
        "Install the plugin that provides the type; `joshua plugins` lists what is installed.",
    ),
    "plugin-block-incomplete": CodeDoc(
        "The settings of a plugin lack fields that their own schema requires.",
        "Add the fields.",
    ),
    # Includes
    "include-missing": CodeDoc(
        "An included file does not exist; its path is relative to the file that includes it.",
        "Correct the path or create the file.",
    ),
    "include-cycle": CodeDoc(
        "A file includes itself, directly or by way of others.",
        "Delete one include of the chain.",
    ),
    "include-twice": CodeDoc(
        "One file is included from two places, which would add its content twice.",
        "Keep one of the two includes.",
    ),
    "set-in-two-files": CodeDoc(
        "A field that holds one value is set in two files.",
        "Keep it in one of them; --set replaces a value without editing.",
    ),
    "too-many-files": CodeDoc(
        "More than 256 files are included.",
        "Join small files.",
    ),
    # joshua fmt
    "format-refused": CodeDoc(
        "The formatted text would not say the same as the file.",
        "Report the file as an error of `joshua fmt`.",
    ),
    # --set
    "override-syntax": CodeDoc(
        "An option --set is not of the form PATH=VALUE or 'PATH { … }'.",
        "Write --set general.name=demo or --set 'robot.actions[0].node.qos { depth: 5 }'.",
    ),
    "override-index": CodeDoc(
        "An option --set names an entry of a list that does not exist, or no entry where one is needed.",
        "Name the entry by its index or by the name of its node.",
    ),
    "override-include": CodeDoc(
        "An option --set sets include, but files are included before options are applied.",
        "Write the include in the file.",
    ),
}
