"""Files of behaviour trees: what is written is read as an equal value, and a malformed file is an error with its place."""

import random
import re
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from tree_strategies import files

from dsc.trees import load_trees, parse_trees, trees_to_xml
from knowledge_base.errors import InputError, collecting

GROOT = Path(__file__).with_name("groot.xml")
FORMAT_3 = Path(__file__).with_name("format_3.xml")


@given(files())
def test_a_file_that_is_written_is_read_as_an_equal_value(file):
    again = parse_trees(trees_to_xml(file), "again.xml")
    assert again == file
    assert trees_to_xml(again) == trees_to_xml(file)


@pytest.mark.parametrize("path", [GROOT, FORMAT_3], ids=lambda path: path.stem)
def test_a_file_of_groot_is_read_written_and_read(path):
    file = load_trees(path)
    assert parse_trees(trees_to_xml(file)) == file
    assert all(node.place.source == str(path) for tree in file.trees.values() for node in tree.root.walk())


def test_a_file_of_format_3_has_the_names_of_format_4():
    file = load_trees(FORMAT_3)
    root = file.trees["Main"].root
    assert root.kind == "SequenceWithMemory"
    parallel, retry, plain, plus = root.children
    assert (parallel.kind, dict(parallel.ports)) == ("Parallel", {"success_count": "2", "failure_count": "1"})
    assert retry.kind == "RetryUntilSuccessful"
    assert (plain.kind, plain.tree, dict(plain.ports)) == ("SubTree", "Inner", {"target": "{goal}"})
    assert dict(plus.ports) == {"target": "{goal}", "speed": "1.5", "_autoremap": "true"}


def test_a_check_collects_the_errors_of_several_nodes():
    text = '<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence>\n<Repeat num_cycle="1"><A/></Repeat>\n<Sleep msec="x"/></Sequence></BehaviorTree></root>'
    with collecting() as errors:
        parse_trees(text, "two.xml")
    assert [(error.place.line, error.nearest) for error in errors] == [(2, "num_cycles"), (3, None)]


BAD = [
    ("<a/>", "f.xml:1:1: <root> was expected; found <a>"),
    ("<root><b/></root>", "f.xml:1:7: <b> is not allowed in <root>"),
    ("<root/>", "f.xml:1:1: a file needs at least one <BehaviorTree>"),
    ('<root BTCPP_format="5"/>', "f.xml:1:1: <root>: the format '5' is unknown"),
    ('<root BTCPP_format="4"><include path="a"/></root>', "f.xml:1:24: <include> has no counterpart: copy"),
    ("<root><BehaviorTree ID='A'><B/></BehaviorTree>\n<BehaviorTree ID='A'><B/></BehaviorTree></root>", "f.xml:2:1: <BehaviorTree ID='A'> exists already, at line 1"),
    ("<root main_tree_to_execute='B'><BehaviorTree ID='A'><B/></BehaviorTree></root>", "f.xml:1:1: <root>: main_tree_to_execute names no tree of the file, but 'B'; valid: A"),
    ("<root><BehaviorTree ID='A'><B/></BehaviorTree><BehaviorTree><B/></BehaviorTree></root>", "<BehaviorTree> needs the attribute 'ID'"),
    ("<root><BehaviorTree ID='A'/></root>", "f.xml:1:7: <BehaviorTree ID='A'> needs one child; found 0"),
    ("<root><BehaviorTree ID='A'><B/><C/></BehaviorTree></root>", "needs one child; found 2"),
    ("<root><BehaviorTree ID='A'>text<B/></BehaviorTree></root>", "<BehaviorTree> holds the text 'text'"),
    ("<!DOCTYPE root [<!ENTITY a 'b'>]><root/>", "f.xml:1:16: a document type (and with it entities) is not read"),
    ("<root>", "f.xml:1:7: not readable as XML"),
    ("<TREE><Script code='x := 1'/></TREE>", "<Script> exists since format 4: write BTCPP_format"),
    ("<TREE><B _skipIf='true'/></TREE>", "<B>: '_skipIf' exists since format 4"),
    ("<TREE4><SequenceStar><B/></SequenceStar></TREE4>", "<SequenceStar> is a name of format 3: in format 4 write SequenceWithMemory"),
    ("<TREE4><SubTree ID='A'/></TREE4>", "<SubTree ID='A'>: the tree 'A' contains itself"),
    ("<TREE4><SubTree ID='C'/></TREE4>", "<SubTree ID='C'>: the file has no tree 'C'"),
    ("<TREE4><SubTree/></TREE4>", "<SubTree> needs the attribute 'ID'"),
    ("<TREE4><SubTree ID='A'><B/></SubTree></TREE4>", "<SubTree ID='A'> has a child"),
    ("<TREE4><TryCatch><B/><C/></TryCatch></TREE4>", "<TryCatch> has no counterpart: write"),
    ("<TREE4><Control ID='Inverter'><B/></Control></TREE4>", "<Control ID='Inverter'>: 'Inverter' is a decorator, not a control"),
    ("<TREE4><Decorator ID='Mine'><B/></Decorator></TREE4>", "<Decorator> 'Mine' is a decorator of another program"),
    ("<TREE4><Sequence ID='x'><B/></Sequence></TREE4>", "<Sequence> has no attribute 'ID'"),
    ("<TREE4><SubTre ID='B'/></TREE4>", "<SubTre> has no attribute 'ID', which only the explicit form has; did you mean 'SubTree'?"),
    ("<TREE4><Inverter><B/><C/></Inverter></TREE4>", "<Inverter> has 1 child; found 2"),
    ("<TREE4><IfThenElse><B/></IfThenElse></TREE4>", "<IfThenElse> has 2 to 3 children; found 1"),
    ("<TREE4><Switch2 variable='{x}'><B/><C/></Switch2></TREE4>", "<Switch2> has 3 children; found 2"),
    ("<TREE4><Repeat><B/></Repeat></TREE4>", "<Repeat> needs the port 'num_cycles'"),
    ("<TREE4><Repeat num_cycles='two'><B/></Repeat></TREE4>", "<Repeat>: the port 'num_cycles' is an integer or a {key}, not 'two'"),
    ("<TREE4><RunOnce then_skip='maybe'><B/></RunOnce></TREE4>", "the port 'then_skip' is true, false or a {key}, not 'maybe'"),
    ("<TREE4><Precondition if='true' else='FAIL'><B/></Precondition></TREE4>", "the port 'else' is a status, not 'FAIL'; did you mean 'FAILURE'?"),
    ("<TREE4><SetBlackboard output_key='x'/></TREE4>", "<SetBlackboard> needs the port 'value'"),
    ("<TREE4><B _onSucess='x := 1'/></TREE4>", "<B> has no attribute '_onSucess'; did you mean '_onSuccess'?"),
    ("<TREE4><Script code='x :='/></TREE4>", "<Script>: 'code': an operand was expected; found the end, at position 5"),
    ("<TREE4><Script code='1 = x'/></TREE4>", "left of '=' a name was expected"),
    ("<TREE4><Script code='x := 1 | 2'/></TREE4>", "the operator '|' on bits is not supported"),
    ("<TREE4><Script code='x := 3foo'/></TREE4>", "no token begins at position 6"),
    ("<TREE4><Script code=' '/></TREE4>", "the script is empty"),
    ("<TREE4><Script code='x y'/></TREE4>", "';' or the end was expected; found 'y'"),
    (f"<TREE4><Script code='{'(' * 60}'/></TREE4>", "nested deeper than 50 levels"),
    ("<TREE4><Script code='a := 9223372036854775808'/></TREE4>", "the integer '9223372036854775808' has more than 64 bits"),
    (f"<TREE4><Script code='a := {'9' * 5000}'/></TREE4>", "has more than 64 bits"),
    (f"<TREE4>{'<Inverter>' * 120}<B/>{'</Inverter>' * 120}</TREE4>", "nested deeper than 100 levels"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "said"), BAD)
def test_a_mistake_in_a_file_has_its_place_and_a_remedy(text, said):
    text = text.replace("<TREE4>", "<root BTCPP_format='4'><BehaviorTree ID='A'>").replace(
        "<TREE>", "<root><BehaviorTree ID='A'>"
    )
    text = re.sub("</TREE4?>", "</BehaviorTree></root>", text)
    with pytest.raises(InputError) as caught:
        parse_trees(text, "f.xml")
    assert said in str(caught.value)
    assert re.match(r"f\.xml:\d+:\d+: ", str(caught.value))


def break_file(text, draw):
    """Return the text with one mistake: a changed name, a removed or doubled piece, or a lost sign."""
    tags = list(re.finditer(r"</?[\w]+|\w+=\"[^\"]*\"|/?>", text))
    at = draw.choice(tags)
    piece = at[0]
    kind = draw.randrange(6)
    if kind == 0 and piece.startswith("<"):
        new = piece[:-1]
    elif kind == 1 and "=" in piece:
        new = f"{piece[0]}x{piece[1:]}"
    elif kind == 2 and "=" in piece:
        new = f"{piece} {piece}"
    elif kind == 3 and "=" in piece:
        new = f'{piece.partition("=")[0]}="?"'
    elif kind == 4:
        new = ""
    else:
        new = f"{piece}{draw.choice('<&x')}"
    return text[: at.start()] + new + text[at.end() :]


def break_element(text, draw):
    """Return well-formed XML with one changed, removed or doubled element or attribute."""
    root = ET.fromstring(text)  # noqa: S314
    parents = [one for one in root.iter() if len(one)]
    parent = draw.choice(parents)
    element = draw.choice(list(parent))
    name = draw.choice([*element.attrib, "ID"])
    kind = draw.randrange(6)
    if kind == 0:
        element.tag = f"{element.tag}s"
    elif kind == 1:
        parent.remove(element)
    elif kind == 2:
        parent.append(element)
    elif kind == 3:
        element.attrib.pop(name, None)
    elif kind == 4:
        element.attrib[f"{name}s"] = element.attrib.pop(name, "x")
    else:
        element.attrib[name] = "a :="
    return ET.tostring(root, encoding="unicode")


def refusal(text):
    """Return the error for a text, or `None` if the text is read."""
    try:
        parse_trees(text, "broken.xml")
    except InputError as error:
        return error
    return None


@pytest.mark.parametrize(("break_it", "tries"), [(break_file, 1500), (break_element, 1500)])
def test_200_malformed_files_are_refused_with_file_line_and_element(break_it, tries):
    draw = random.Random(4)  # noqa: S311
    texts = [GROOT.read_text("utf-8"), FORMAT_3.read_text("utf-8")]
    broken = {break_it(draw.choice(texts), draw) for _ in range(tries)}
    errors = [error for text in sorted(broken) if (error := refusal(text))]
    assert len(errors) >= 200
    for error in errors:
        assert re.match(r"broken\.xml:\d+:\d+: ", str(error))
        assert re.search(r"<\w+|readable as XML" if break_it is break_file else r"<\w+", error.message), error
