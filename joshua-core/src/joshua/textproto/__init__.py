"""The protobuf text format with positions: lexer, parser, binder, overrides, formatter."""
