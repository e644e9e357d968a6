"""The prose check of `make lint`: phrases to avoid in documents, comments, texts and test names.

Prints ``file:line: phrase -> plain words`` per hit; the exit status is 1 if there are any.
"""

import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]

PHRASES = {
    r"(?:is|are|was|were|be|been|being) told(?! apart)": "is reported, receives",
    r"(?:tells?|told|telling) (?:of|how|what|whether|which|that|when|where|why)": "reports, shows",
    r"(?:is|are) what (?:it|they) (?:is|are)": "say what it is",
    r"what there (?:is|are)": "the contents, the list of",
    r"so many": "the number, N",
    r"held to": "verified against, limited to",
    r"com(?:e|es|ing) along": "is included, is shipped with",
    r"h(?:ang|angs|ung) on": "depends on",
    r"put(?:s|ting)? up with": "tolerates",
    r"who ha(?:s|ve) not": "without",
    r"as one likes": "any, as needed",
    r"of one's own": "your own",
    r"ha(?:s|ve) to be": "must be",
    r"ask(?:s|ed|ing)? for": "requests",
    r"exit code": "exit status",
    r"counter[- ]examples?": "counterexample",
    r"(?:times|bytes|bits|frames|images|pictures|events|steps|points|lines|samples|requests|MB|kB)"
    r" a (?:second|minute|hour|day|frame|image)": "per second",
}

ALLOWED = {("tests/prose.py", ""), ("tests/test_prose.py", "")}
"""Files and matched phrases that are right; an empty phrase allows the whole file."""

PATTERN = re.compile(
    rf"\b(?:{'|'.join(f'({phrase})' for phrase in PHRASES)})\b".replace(" ", r"\s+"), re.IGNORECASE
)

C_LIKE = re.compile(
    r"//[^\n]*|/\*.*?\*/|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*'|`[^`]*`", re.DOTALL
)
"""Comments and literals of C, C++, JavaScript and CSS."""

CODE = re.compile(r"^```.*?^```|`[^`\n]*`", re.DOTALL | re.MULTILINE)
"""Code in Markdown."""


def hits(path: str, text: str) -> Iterator[tuple[int, str, str]]:
    """Line, phrase and plain words of each hit in the prose of a file."""
    prose = _prose(Path(path).suffix, text)
    for found in PATTERN.finditer(prose):
        phrase = " ".join(found[0].lower().split())
        if not {(path, ""), (path, phrase)} & ALLOWED:
            assert found.lastindex is not None
            plain = [*PHRASES.values()][found.lastindex - 1]
            yield prose.count("\n", 0, found.start()) + 1, phrase, plain


def _prose(suffix: str, text: str) -> str:
    """The text without code and quotes; lines stay, and code separates phrases."""
    if suffix == ".md":
        return CODE.sub(lambda found: _hidden(found[0]), text)
    spans = _python_spans(text) if suffix == ".py" else (m.span() for m in C_LIKE.finditer(text))
    parts, end = list[str](), 0
    for begin, stop in spans:
        marks = r"_" if text.startswith("test_", begin) else r"[#\"'/*`]"
        parts += [_hidden(text[end:begin]), re.sub(marks, " ", text[begin:stop])]
        end = stop
    return "".join([*parts, _hidden(text[end:])])


def _hidden(code: str) -> str:
    return re.sub(r"\S", "\0", code)


def _python_spans(text: str) -> Iterator[tuple[int, int]]:
    starts = [0]
    for line in io.StringIO(text):
        starts.append(starts[-1] + len(line))
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        kind = tokenize.tok_name[token.type]
        is_test = kind == "NAME" and token.string.startswith("test_")
        if is_test or kind in ("STRING", "COMMENT", "FSTRING_MIDDLE"):
            (line, column), (last, end) = token.start, token.end
            yield starts[line - 1] + column, starts[last - 1] + end


def sources() -> list[str]:
    """Files under version control with prose."""
    kinds = ["*.md", "*.py", "*.c", "*.h", "*.cpp", "*.hpp", "*.S", "*.js", "*.css"]
    call = ["git", "ls-files", *kinds]
    listed = subprocess.run(call, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [path for path in listed.splitlines() if "/vendor/" not in path]


def main() -> int:
    found = 0
    for path in sources():
        for line, phrase, plain in hits(path, (ROOT / path).read_text("utf-8")):
            print(f"{path}:{line}: {phrase} -> {plain}")
            found += 1
    return int(found > 0)


if __name__ == "__main__":
    sys.exit(main())
