"""A small interpreter for the structured text that the export writes, and for no more."""

import re
from collections.abc import Iterator, Sequence

_COMMENT = re.compile(r"\(\*.*?\*\)", re.DOTALL)
_TOKEN = re.compile(r"\s*(?:(-?\d+\.\d+(?:E-?\d+)?)|(-?\d+)|([A-Za-z]\w*)|(:=|<=|[:;(),]))")


def tokens(source: str) -> Iterator[str]:
    text = _COMMENT.sub(" ", source)
    assert "(*" not in text
    assert "*)" not in text
    position = 0
    while text[position:].strip():
        match = _TOKEN.match(text, position)
        assert match, f"not structured text: {text[position : position + 40]!r}"
        yield match[0].strip()
        position = match.end()


class Program:
    """Functions of a source, parsed by recursive descent."""

    def __init__(self, source: str) -> None:
        self.stream = [*tokens(source), ""]
        self.place = 0
        self.functions: dict[str, tuple[list[str], list]] = {}
        while self.stream[self.place]:
            name, kind = self.function()
            if kind == "INT":
                self.main = name

    def take(self, *expected: str) -> str:
        token = self.stream[self.place]
        self.place += 1
        assert not expected or token.upper() in expected, (token, expected)
        return token

    def next_is(self, word: str) -> bool:
        return self.stream[self.place].upper() == word

    def function(self) -> tuple[str, str]:
        self.take("FUNCTION")
        name = self.take().upper()
        self.take(":")
        kind = self.take("INT", "LREAL").upper()
        self.take("VAR_INPUT")
        inputs = []
        while not self.next_is("END_VAR"):
            inputs.append(self.take().upper())
            self.take(":")
            self.take("LREAL")
            self.take(";")
        self.take("END_VAR")
        assert len(set(inputs)) == len(inputs)
        assert name not in inputs
        if kind == "INT":
            self.functions[name] = (inputs, self.statements(name, "END_FUNCTION"))
        else:
            self.functions[name] = (inputs, [self.table(name)])
        self.take("END_FUNCTION")
        return name, kind

    def table(self, name: str) -> tuple:
        """Parse CASE function(...) OF number: name := value; ... END_CASE;."""
        self.take("CASE")
        called = self.take().upper()
        assert called in self.functions, "functions must be declared before they are called"
        arguments, values = self.arguments(), {}
        self.take("OF")
        while not self.next_is("END_CASE"):
            number = int(self.take())
            self.take(":")
            assert self.take().upper() == name
            self.take(":=")
            assert number not in values
            values[number] = float(self.take())
            self.take(";")
        self.take("END_CASE")
        self.take(";")
        return ("table", ("call", called, arguments), values)

    def arguments(self) -> list[str]:
        found = []
        self.take("(")
        while self.stream[self.place - 1] != ")":
            found.append(self.take().upper())
            self.take(",", ")")
        return found

    def statements(self, name: str, *ends: str) -> list:
        found = []
        while self.stream[self.place].upper() not in ends:
            found.append(self.choice(name) if self.next_is("IF") else self.assignment(name))
        return found

    def choice(self, name: str) -> tuple:
        branches = []
        while self.take("IF", "ELSIF", "ELSE", "END_IF").upper() != "END_IF":
            if self.stream[self.place - 1].upper() == "ELSE":
                test = None
            else:
                variable = self.take().upper()
                self.take("<=")
                test = (variable, float(self.take()))
                self.take("THEN")
            branches.append((test, self.statements(name, "ELSIF", "ELSE", "END_IF")))
        self.take(";")
        return ("if", branches)

    def assignment(self, name: str) -> tuple:
        assert self.take().upper() == name
        self.take(":=")
        value = self.take()
        if re.fullmatch(r"\d+", value):
            self.take(";")
            return ("value", int(value))
        arguments = self.arguments()
        self.take(";")
        assert value.upper() in self.functions, "functions must be declared before they are called"
        return ("call", value.upper(), arguments)

    def run(self, name: str, values: Sequence[float]) -> int:
        inputs, statements = self.functions[name]
        return self.execute(statements, dict(zip(inputs, values, strict=True)))

    def execute(self, statements: list, variables: dict[str, float]) -> int:
        (statement,) = statements
        if statement[0] == "value":
            return statement[1]
        if statement[0] == "table":
            return statement[2][self.execute([statement[1]], variables)]
        if statement[0] == "call":
            return self.run(statement[1], [variables[argument] for argument in statement[2]])
        for test, inside in statement[1]:
            if test is None or variables[test[0]] <= test[1]:
                return self.execute(inside, variables)
        raise AssertionError("no branch was taken")
