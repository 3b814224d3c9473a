"""Every sentence with which eutree refuses or warns, read from its source, and its family.

A sentence is a template: what is known only when it is said stands in it as ``<name>``. The page of
messages says of each family what it means and what to do; its tables are made of this list.
"""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from itertools import product
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2] / "src"
WORD = re.compile(r"[a-z]{2,}", re.IGNORECASE)
HOLE = re.compile(r"<[\w.]+>")
SHOWN_AS_IS = {"shown", "printable", "described", "_brief", "repr", "str", "list", "float", "int"}
REFUSALS = {"refuse": "FormatError", "_fault": "EnvironmentFault"}
WARN = "warn", "warnings.warn"  # what warns
PASSED_ON = "eutree/errors.py"  # where the first is, which says nothing itself
WARNED = re.compile(r"(?:^|_)warnings?$")  # names of what holds sentences of a warning
DEEPEST = 7  # steps from a sentence to its words
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Said:
    """One template: the type of the error, or ``warning``; the file; the sentence."""

    kind: str
    file: str
    text: str


@dataclass(frozen=True)
class Family:
    """Sentences that mean one thing: of these types, in these files, with these words."""

    name: str
    kinds: str = ".*"
    files: str = ""
    words: str = ""

    def has(self, one: Said) -> bool:
        """Return whether a sentence belongs to it."""
        return bool(
            re.fullmatch(self.kinds, one.kind)
            and re.search(self.files, one.file)
            and re.search(self.words, one.text)
        )


ARGUMENT = r"InvalidArgumentError|ValueError|TypeError|BadParameter|UsageError|EutreeError"
SHAPES = r"must (have|be) (the |finite numbers of )?shapes?\b|\b(entries|rows?|columns?|vectors?)\b"
FAMILIES = (  # the first that has a sentence
    Family("warnings", "warning"),
    Family("names", "UnknownNameError"),
    Family("names", ARGUMENT, r"interaction/making", r"is a tree of the zoo|example of the repos"),
    Family("extras", "MissingExtraError"),
    Family("spaces", "UnsupportedSpaceError"),
    Family("environments", "EnvironmentFault|ResetNeeded"),
    Family("environments", "TypeError", r"interaction/spaces", r"numbers?$|observations$"),
    Family("environments", ARGUMENT, r"interaction/", r"must allow|decode (raised|must)|mask must"),
    Family("environments", ARGUMENT, r"cli/record", r"must draw"),
    Family("folders", "RunFolderError"),
    Family("folders", ARGUMENT, r"cli/_given", r"begun with|folder of a run|arguments of the"),
    Family("reading", "FileError"),
    Family("states", "FormatError", r"learners/|/method\.py|race_state|checkpoint|training/many"),
    Family("formats", "FormatError"),
    Family("formats", ARGUMENT, r"files/|study/plan", r"."),
    Family("logs", ARGUMENT, r"data/(csv_files|log_format|npz_files|minari_files)"),
    Family("recorder", ARGUMENT, r"recording/browser", r"message|key|picture|client|must|listen"),
    Family("proofs", "NeedsEpisodesError"),
    Family("proofs", ARGUMENT, r"eutree/proof/|plants/", r"plant|property|proof|proven|range"),
    Family("proofs", ARGUMENT, r"eutree/proof/", r"cells|boxes|starts|certificate|no success"),
    Family("imports", ARGUMENT, "", r"cannot (be imported|import|make)|no file may|by several"),
    Family("imports", ARGUMENT, r"cli/_policies", r"there is no file|has no|name what decides"),
    Family("methods", ARGUMENT, r"learners/(registry|learner)\.|vrd/method", r"method"),
    Family("methods", ARGUMENT, r"learners/", r"update must be called"),
    Family("together", ARGUMENT, "", r"\bneeds?\b|leave out|choose one|\btakes no\b|left out"),
    Family(
        "together", ARGUMENT, "", r"must be (None|0|empty|False|left out)\b(?! \(| or)|got both"
    ),
    Family("together", ARGUMENT, "", r"--\S+ (says|learns|decides|is of a)|is a part of|are for"),
    Family("together", ARGUMENT, "", r"understood by|is given <count> times"),
    Family("other", ARGUMENT, "", r"\bnot of\b|of this policy|another folder|features and actions"),
    Family("other", ARGUMENT, "", r"the demonstrations (have|are)"),
    Family("nothing", ARGUMENT, "", r"names? (an|no) environment|there (is|are) no|holds no"),
    Family("nothing", ARGUMENT, "", r"has no (episode|person)|got none|holds none|name one"),
    Family("nothing", ARGUMENT, "", r"is not known$"),
    Family("shapes", ARGUMENT, "", SHAPES),
    Family("arguments", ARGUMENT, "", r"\bmust\b|expected|more than|at most|not be\b"),
    Family("arguments", ARGUMENT, "", r"unknown categories|nested too|not a decision tree|; got "),
    Family("arguments", ARGUMENT, "", r"^(the )?episode <|ended before|could not be compiled"),
)

UNREAD = {  # raised, and never read as it is: by type, in these files
    r"KeyboardInterrupt|SystemExit": ("", "a signal, or an exit code"),
    r"NotImplementedError": ("", "of a method that every subclass has"),
    r"MissingParameter": ("cli/", "click says which argument is missing"),
    r"AttributeError": ("eutree/lazy", "Python's own sentence of a module"),
    r"KeyError": ("learners/registry", "what a mapping raises"),
    r"ValueError": ("cli/_options", "caught some lines below"),
    r"TimeoutError": ("cli/parts", "stands in the sentence about --address"),
    r"_DuplicateKeyError|RecursionError": ("files/documents", "caught by who decodes"),
    r"_NobodyWaits": ("fitting/page_tree", "ends work that nobody waits for"),
    r"TypeError": ("eutree_lab/paper", "a row of the registry of experiments without its part"),
}


_known: dict[tuple[int, int], list[str]] = {}  # templates by the node and how deep it was met


@dataclass
class _Module:
    file: str
    tree: ast.Module
    nodes: list[ast.AST] = field(default_factory=list)
    functions: dict[str, Function] = field(default_factory=dict)
    imported: dict[str, str] = field(default_factory=dict)  # name: the module that it is from
    within: dict[int, Function] = field(default_factory=dict)  # the function around a node
    values: dict[int, dict[str, list[ast.expr]]] = field(default_factory=dict)  # set in a function


@cache
def _modules() -> list[_Module]:
    found = []
    for path in sorted(SOURCE.rglob("*.py")):
        tree = ast.parse(path.read_text())
        module = _Module(path.relative_to(SOURCE).as_posix(), tree)
        for node in ast.walk(tree):
            module.nodes.append(node)
            around = node if isinstance(node, Function) else module.within.get(id(node))
            if around is not None:
                module.within |= {id(child): around for child in ast.iter_child_nodes(node)}
            if isinstance(node, Function):
                module.functions[node.name] = node
            elif isinstance(node, ast.ImportFrom) and node.module:
                module.imported |= {alias.name: node.module for alias in node.names}
        found.append(module)
    return found


@cache
def _calls() -> dict[str, list[tuple[_Module, ast.Call]]]:
    """Return all calls by the name of what is called."""
    found: dict[str, list[tuple[_Module, ast.Call]]] = {}
    for module in _modules():
        for node in module.nodes:
            if isinstance(node, ast.Call):
                found.setdefault(_last(node.func), []).append((module, node))
    return found


def _last(node: ast.AST) -> str:
    """Return the last name of a dotted one."""
    return getattr(node, "attr", getattr(node, "id", ""))


def _hole(node: ast.AST) -> str:
    """Return the placeholder of a value."""
    if isinstance(node, ast.Call) and node.args and _last(node.func) in SHOWN_AS_IS:
        return _hole(node.args[0])
    if isinstance(node, ast.Subscript):
        return _hole(node.value)
    name = _last(node.func if isinstance(node, ast.Call) else node).strip("_")
    return f"<{name.lower() or '...'}>"


def _texts(node: ast.AST, module: _Module, depth: int = 0) -> list[str]:
    """Return the templates that an expression can be."""
    key = id(node), depth
    if key not in _known:
        _known[key] = []  # of an expression that leads back to itself
        _known[key] = list(dict.fromkeys(_found(node, module, depth)))
    return _known[key]


def _found(node: ast.AST, module: _Module, depth: int) -> list[str]:
    if depth > DEEPEST:
        return []
    if isinstance(node, ast.Constant):
        return [node.value] if isinstance(node.value, str) else []
    if isinstance(node, ast.IfExp):
        return _texts(node.body, module, depth + 1) + _texts(node.orelse, module, depth + 1)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        sides = (_texts(side, module, depth) or [_hole(side)] for side in (node.left, node.right))
        return ["".join(pair) for pair in product(*sides)]
    if isinstance(node, ast.JoinedStr):
        return _joined(node, module, depth)
    if isinstance(node, ast.List | ast.Tuple | ast.GeneratorExp | ast.ListComp | ast.Starred):
        parts = getattr(node, "elts", None) or [getattr(node, "elt", getattr(node, "value", None))]
        return [text for part in parts for text in _texts(part, module, depth + 1)]
    if isinstance(node, ast.Name):
        return _of_name(node, module, depth + 1)
    if isinstance(node, ast.Call):
        return _of_call(node, module, depth + 1)
    return []


def _joined(node: ast.JoinedStr, module: _Module, depth: int) -> list[str]:
    """Return the templates of an f-string, with clauses of their own in place of their names.

    Where the string itself has hardly a word, all that is known of its values is put into it.
    """
    plain = [v.value if isinstance(v, ast.Constant) else _hole(v.value) for v in node.values]
    few = len(WORD.findall(HOLE.sub("", "".join(plain)))) < 3
    sides = []
    for value, hole in zip(node.values, plain, strict=True):
        inner = getattr(value, "value", None)
        if isinstance(value, ast.Constant) or not (few or isinstance(inner, ast.Name)):
            sides.append([hole])
        elif few:
            sides.append(_worded(_texts(inner, module, depth + 1), 2) or [hole])
        else:
            sides.append(_worded(_set_here(inner, module, depth + 1), 5) or [hole])
    return ["".join(one) for one in product(*sides)]


def _worded(texts: list[str], least: int) -> list[str]:
    """Return the templates that have so many words of their own."""
    return [one for one in texts if len(WORD.findall(HOLE.sub("", one))) >= least]


def _set_here(node: ast.Name, module: _Module, depth: int) -> list[str]:
    """Return the templates that the function around a variable sets it to."""
    around = module.within.get(id(node))
    if around is None:
        return []
    if id(around) not in module.values:
        found: dict[str, list[ast.expr]] = {}
        for one in ast.walk(around):
            for name, value in _set_by(one):
                found.setdefault(name, []).append(value)
        module.values[id(around)] = found
    given = module.values[id(around)].get(node.id, [])
    return [text for value in given for text in _texts(value, module, depth)]


def _of_name(node: ast.Name, module: _Module, depth: int) -> list[str]:
    """Return the templates that a variable can be: what it is set to, or what it is called with."""
    found, around = _set_here(node, module, depth), module.within.get(id(node))
    if found or around is None or around.name.startswith("__"):
        return found
    names = [given.arg for given in around.args.posonlyargs + around.args.args]
    if node.id in names:
        place = names.index(node.id) - (names[0] in ("self", "cls"))
        for elsewhere, call in _calls().get(around.name, []):
            given = [k.value for k in call.keywords if k.arg == node.id] + call.args[place:]
            if given:
                found += _texts(given[0], elsewhere, depth)
    return found


def _set_by(node: ast.AST) -> Iterator[tuple[str, ast.expr]]:
    """Yield the variables that a statement sets, with their values."""
    if isinstance(node, ast.NamedExpr):
        yield node.target.id, node.value
    if not isinstance(node, ast.Assign | ast.For | ast.comprehension):
        return
    value = node.value if isinstance(node, ast.Assign) else node.iter
    for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
        if isinstance(target, ast.Tuple):
            rows = value.elts if isinstance(value, ast.Tuple | ast.List) else []
            for row in rows:
                if isinstance(row, ast.Tuple) and len(row.elts) == len(target.elts):
                    yield from zip(map(_last, target.elts), row.elts, strict=True)
        else:
            yield _last(target), value


@cache
def _homes() -> dict[str, list[_Module]]:
    """Return the modules that have a function of a name."""
    found: dict[str, list[_Module]] = {}
    for module in _modules():
        for name in module.functions:
            found.setdefault(name, []).append(module)
    return found


def _home(name: str, module: _Module) -> _Module | None:
    """Return the module of the function that a name means in a module."""
    if name in module.functions:
        return module
    found = _homes().get(name, [])
    place = module.imported.get(name, "-").replace(".", "/")
    named = [one for one in found if one.file in (f"{place}.py", f"{place}/__init__.py")]
    return named[0] if named else found[0] if len(found) == 1 else None


def _of_call(node: ast.Call, module: _Module, depth: int) -> list[str]:
    """Return the templates that a function of ours can return, yield or append."""
    name = _last(node.func)
    home = _home(name, module)
    if home is None or name in SHOWN_AS_IS:
        return []
    found = []
    for one in ast.walk(home.functions[name]):
        if isinstance(one, ast.Return | ast.Yield) and one.value is not None:
            found += _texts(one.value, home, depth)
        elif isinstance(one, ast.Call) and _last(one.func) == "append" and name != "append":
            found += _texts(one.args[0], home, depth)
    return [text for text in found if text]


def _is_passed_on(node: ast.stmt, made: ast.expr, module: _Module) -> bool:
    """Return whether it raises again, or with the words of the error that it caught."""
    if not isinstance(made, ast.Call):
        return isinstance(made, ast.Name) and made.id.islower()
    caught = {
        one.name
        for one in ast.walk(module.within.get(id(node), module.tree))
        if isinstance(one, ast.ExceptHandler)
    }
    last = made.args[-1] if made.args else None
    while isinstance(last, ast.Call) and last.args and _last(last.func) == "str":
        last = last.args[0]
    return isinstance(last, ast.Name) and last.id in caught


def _raised(node: ast.AST, module: _Module) -> Iterator[Said]:
    """Yield the sentences of a ``raise``, or of a call that ends in one."""
    made = node.exc if isinstance(node, ast.Raise) else getattr(node, "value", None)
    if isinstance(node, ast.Return):
        around = module.within[id(node)].name
        if not (_last(getattr(made, "func", made)).endswith("Error") and around not in REFUSALS):
            return
    elif not isinstance(node, ast.Raise):
        return
    if made is None or _is_passed_on(node, made, module):
        return
    if not isinstance(made, ast.Call):
        yield Said(_last(made), module.file, "<reason>")
        return
    name = _last(made.func)
    if name in module.functions and name not in REFUSALS:
        return  # a function of the same file makes the error
    if name == "UnknownNameError":
        kinds = _texts(made.args[0], module) or [_hole(made.args[0])]
        yield from (Said(name, module.file, f"unknown {kind} <name>") for kind in kinds)
    elif name == "MissingExtraError":
        package = (_texts(made.args[0], module) or ["<package>"])[0]
        yield Said(
            name, module.file, f"{package} is not installed; get it with: pip install <name>"
        )
    else:
        kind = REFUSALS.get(name, name)
        first = "".join(f"{one} " for one in _texts(made.args[0], module)[:1]) if made.args else ""
        texts = _texts(made.args[-1], module) if made.args else []
        if kind == "FileError":
            texts = [f"cannot {first}<path>: {text}" for text in texts or ["<reason>"]]
        yield from (Said(kind, module.file, text) for text in texts or ["<reason>"])


def _warned(node: ast.AST, module: _Module) -> Iterator[Said]:
    """Yield the sentences of a warning: given, printed, or in what is named so."""
    texts: list[str] = []
    if module.file == PASSED_ON:
        return
    if isinstance(node, ast.Call) and ast.unparse(node.func) in WARN:
        texts = _texts(node.args[0], module) or [""]
    elif isinstance(node, ast.Call) and _last(node.func) == "say" and node.args:
        texts = [one for one in _texts(node.args[0], module) if one.startswith("warning:")]
        texts = [text.partition(":")[2].strip() for text in texts]
    elif isinstance(node, ast.Assign | ast.AugAssign | ast.keyword):
        target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", node)
        if WARNED.search(getattr(target, "arg", None) or _last(target)):
            texts = _worded(_texts(node.value, module), 2)
    elif isinstance(node, Function) and WARNED.search(node.name):
        call = ast.Call(ast.Name(node.name), [], [])
        texts = _of_call(call, module, 0)
    yield from (Said("warning", module.file, text) for text in texts)


@cache
def said() -> tuple[Said, ...]:
    """Return each sentence that can be read, once for each file, in the order of the files."""
    found: dict[Said, None] = {}
    for module in _modules():
        for node in module.nodes:
            for one in (*_raised(node, module), *_warned(node, module)):
                found[Said(one.kind, one.file, " ".join(one.text.split()))] = None
    return tuple(one for one in found if not _is_unread(one))


def _is_unread(one: Said) -> bool:
    return any(re.fullmatch(k, one.kind) and file in one.file for k, (file, _) in UNREAD.items())


def family(one: Said) -> str:
    """Return the name of the family of a sentence; empty if it falls into none."""
    return next((kin.name for kin in FAMILIES if kin.has(one)), "")


def packages(name: str) -> dict[str, list[str]]:
    """Return the sentences of a family by the package that says them."""
    found: dict[str, set[str]] = {}
    for one in said():
        if family(one) == name:
            package, place = one.file.removesuffix(".py").split("/")[:2]
            own = f"{package}.{place}" if package == "eutree" else package
            found.setdefault(own, set()).add(one.text)
    return {package: sorted(texts) for package, texts in sorted(found.items())}
