# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameter file reader, compared with the real rcl if rclpy is installed."""

import itertools
import json
import os
import re
import subprocess
import sys
import warnings

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mechanisms import examples
from ros_harness import PATIENCE

from linkage_ros import ConfigurationError, load
from linkage_ros.settings.package_names import read_own_parameters
from linkage_ros.settings.yaml_file import read_parameter_file

# Some files give a name twice.
pytestmark = pytest.mark.filterwarnings('ignore::linkage_ros.errors.ParameterWarning')

# Reads every file as a node does. Each result is a line of JSON, so that a crash shows its case;
# the lines go to a file, because the middleware may write to stdout.
RCL = """
import json, sys
import rclpy
from rclpy.context import Context
from rclpy.node import Node

answers = open(sys.argv[1], 'w')
for path, namespace in zip(sys.argv[2::2], sys.argv[3::2]):
    context = Context()
    try:
        rclpy.init(args=['--ros-args', '--params-file', path], context=context)
        node = Node('linkage_node', namespace=namespace, context=context, enable_rosout=False,
                    start_parameter_services=False)
        answer = {name: repr(p.value) for name, p in node._parameter_overrides.items()}
        node.destroy_node()
    except Exception as error:
        answer = str(error)
    if context.ok():
        context.shutdown()
    print(json.dumps(answer), file=answers, flush=True)
"""


def own(parameters: str, node: str = 'linkage_node') -> str:
    lines = ''.join(f'    {line}\n' for line in parameters.split('\n'))
    return f'{node}:\n  ros__parameters:\n{lines}'


SCALARS = """
    y Y yes Yes YES true True TRUE on On ON n N no No NO false False FALSE off Off OFF
    tRUE yEs oN nO oFF t f T F null Null ~x None
    0 1 -3 +5 -0 +0 0o7 0b11 0x 0xg 0x1G 1_000 --1 +-1 123456789012345678
    9223372036854775808 -9223372036854775809 99999999999999999999999999
    1.5 -1.5 1. .5 -.5 . +. 1e2 1E2 1e+2 1e-2 .5e1 5.e1 1e 1e+ e1 1.5.2 1,5 1f 1.0f 0.1 -0.0 0e5
    1e308 0e-999 .inf .Inf .INF +.inf -.inf -.INF .iNF infinit .nan .NaN .NAN .Nan +.nan -.nan
    x é 🙂 ٣ \uff11 1٣ 12:30 2001-01-01 <<x a/b =x 1.2.3 -x
    "1" '1' "" '' "true" '.nan' "a\\u00e9" 'it''s'
"""
NODES = """
    linkage_node /linkage_node /** /* "**" "*" /**/linkage_node /*/linkage_node /**/* /*/** /**/**
    /*/* "**/linkage_node" other /other /**/other ns/linkage_node /ns/** /**/ns/* LINKAGE_NODE
    linkage_node2
"""
NAMESPACED = """
    /ns/linkage_node ns/linkage_node /ns/a/linkage_node /a/ns/linkage_node /a/linkage_node /*/*/*
    /ns/*/linkage_node /*/a/linkage_node /ns/**/linkage_node /**/a/** /**/a/* /ns/a/* /**/*/**
"""
NAMESPACES = ('/ns', '/ns/a')

# Files on which rcl and the reader must agree: the same values and types, or a refusal.
AGREED = {
    **{f'scalar {text}': own(f'a: {text}') for text in SCALARS.split()},
    **{
        f'list {text}': own(f'a: {text}')
        for text in [
            '[1, 2]',
            '[1.0, 2e0]',
            '[on, false]',
            '[x, "1", \'true\', ""]',
            '[0, -9.81]',
            '[-9.81, 0]',
            '[1, x]',
            '[x, 1]',
            '[true, 1]',
            '[1, "1"]',
            '[1, ]',
            '[1, , 2]',
            '[1 2]',
            '[[1], [2]]',
            '[~, ~]',
            '[null]',
            '[.nan, .inf]',
            '[1',
            '1]',
            '[9223372036854775808, 1.5]',
            '[9223372036854775808, 1]',
        ]
    },
    'list block': own('a:\n- 1\n- 2'),
    'list block indented': own('a:\n  - 1.5\n  - 2.5'),
    'list block with an empty item': own('a:\n- 1\n-'),
    'text over two lines': own('a: 1\n  2'),
    'text quoted over two lines': own('a: "x\n\n  y"'),
    'text with escapes': own(r'a: "\t\n\x41\U0001F642"'),
    'text with a bad escape': own(r'a: "\q"'),
    'text with a surrogate': own(r'a: "\ud800"'),
    'text beyond Unicode': own(r'a: "\U00110000"'),
    'text far beyond Unicode': own(r'a: "\UFFFFFFFF"'),
    'text not closed': own('a: "x'),
    'value missing': own('a:'),
    'value missing before another': own('a:\nb: 1'),
    'value a comment': own('a: # 1'),
    'value with a comment': own('a: 1 # 2'),
    'value ~': own('a: ~'),
    'key quoted': own('"a": 1\n\'b\': 2'),
    'key a number': own('1: 1\n1.5: 2\ntrue: 3'),
    'key explicit': own('? a\n: 1'),
    'key without value': own('? a'),
    'key empty': own('"": 1'),
    'key missing': own(': 1'),
    'key a list': own('[a]: 1'),
    'key a mapping': own('{a: 1}: 2'),
    'key merge': own('<<: {a: 1}'),
    'key with a space': own('a b: 1'),
    'key tagged': own('!!int a: 1'),
    'keys in flow': own('{a: 1, b: 2}'),
    'group': own('a:\n  b: 1\n  c:\n    d: 2\n  e: 3'),
    'group in flow': own('a: {b: 1, c: {d: 2}, e: 3}'),
    'group dotted': own('a.b: 1\na.c.d: 2'),
    'value dotted within a group': own('a: {b.c: 1, d: 2}'),
    'group dotted holding another': own('a.b: {c: {d: 1}, e: 2}\nf: 3'),
    'group named with dots only': own('..: {d: 1}'),
    'group then value': own('a: {b: 1}\na: 2'),
    'many parameters': own('\n'.join(f'p{i}: {i}' for i in range(300))),
    'twice, same type': own('a: 1\na: 2'),
    'twice, same type of list': own('a: [1, 2]\na: [3]'),
    'twice, in a group': own('a: {b: 1, b: 2}'),
    'twice, group repeated': own('a: {b: 1}\na: {c: 2}'),
    'twice, dotted then grouped': own('a.b: 1\na: {b: 2}'),
    'anchor': own('a: &x 1'),
    'anchor and alias': own('a: &x 1\nb: *x'),
    'alias unknown': own('a: *x'),
    'alias as key': own('a: &x b\n*x : 1'),
    'alias merged': own('a: &x {b: 1}\nc: {<<: *x}'),
    **{f'section {node}': own('a: 1', node) for node in NODES.split()},
    'section in a name space': '/**:\n  linkage_node:\n    ros__parameters:\n      a: 1\n',
    'section in the root': '/: {linkage_node: {ros__parameters: {a: 1}}}',
    'section in the root, with another': (
        '/: {other: {ros__parameters: {a: 1}}, linkage_node: {ros__parameters: {b: 1}}}'
    ),
    'section in a name space, then its own': (
        '/**: {other: {ros__parameters: {a: 1}}, ros__parameters: {b: 1}}'
    ),
    'sections in order': own('a: 1\nb: 1', '/**') + own('a: 2') + own('b: 3', '/*'),
    'sections in the other order': own('a: 2') + own('a: 1\nb: 1', '/**'),
    'sections with two types': own('a: 1', '/**') + own('a: x'),
    'section repeated': own('a: 1') + own('b: 2') + own('a: 3'),
    'section of another node with two types': own('a: 1\na: x', 'other') + own('a: 1'),
    'section of another node that is wrong': own('a: [1, x]', 'other') + own('a: 1'),
    'section empty': 'linkage_node: {ros__parameters: {}}',
    'section empty, then another': 'linkage_node: {ros__parameters: {}}\n' + own('a: 1', '/**'),
    'section without ros__parameters': 'linkage_node: {}\n',
    'section with nothing': 'linkage_node:\n',
    'section with values only': 'linkage_node: {a: 1}',
    'section with groups only': 'linkage_node: {a: {b: 1}}',
    'section with a list': 'linkage_node: [1]',
    'ros__parameters first': 'ros__parameters:\n  a: 1\n',
    'ros__parameters misspelt': 'linkage_node: {ros_parameters: {a: 1}}',
    'ros__parameters in itself': own('ros__parameters: {a: 1}'),
    'ros__parameters with nothing': 'linkage_node:\n  ros__parameters:\n',
    'ros__parameters with a value': 'linkage_node: {ros__parameters: 1}',
    'ros__parameters with a list': 'linkage_node: {ros__parameters: [1]}',
    'many sections': ''.join(own('a: 1', f'n{i}') for i in range(200)) + own('a: 2'),
    'file empty': '',
    'file of comments': '# a: 1\n\n',
    'file of one mapping, empty': '{}',
    'file of a list': '- 1\n',
    'file of a list in flow': '[]',
    'document empty': '---\n',
    'document ended': own('a: 1') + '...\n',
    'documents two': own('a: 1') + '---\n' + own('a: 2\nb: 2'),
    'documents two, one empty': own('a: 1') + '---\n',
    'documents two, one wrong': own('a: 1') + '---\n' + own('a: [1, x]'),
    'directive': '%YAML 1.1\n---\n' + own('a: 1'),
    'directive of another version': '%YAML 2.0\n---\n' + own('a: 1'),
    'tab before a key': own('\ta: 1'),
    'tab before a value': own('a:\t1'),
    'tab for indentation': 'linkage_node:\n\tros__parameters:\n\t\ta: 1\n',
    'indentation wrong': own('a: 1\n  b: 2'),
    'colon without space': own('a:1'),
    'colon in a value': own('a: b: c'),
    'percent': own('a: %x'),
    'at sign': own('a: @x'),
    'bracket wrong': own('a: {b: 1]'),
    'line ends of Windows': own('a: 1\nb: x').replace('\n', '\r\n'),
    'line ends of old Mac': own('a: 1\nb: x').replace('\n', '\r'),
    'byte order mark': '\ufeff' + own('a: é'),
    'UTF-16': own('a: é').encode('utf-16'),
    'UTF-32': own('a: é').encode('utf-32'),
    'Latin-1': own('a: é').encode('latin-1'),
    'control character': own('a: \x01'),
    'NUL byte': own('a: \0'),
}

# Files that rcl accepts and the reader refuses, with the reason.
STRICTER = {
    'empty list': (own('a: []'), 'rcl makes a parameter without type or value of it'),
    'list in a list': (own('a: [[1, 2]]'), 'rcl drops the inner brackets'),
    'mapping in a list': (own('a: [{b: 1}]'), 'rcl makes a list a.b of it'),
    'NUL in a value': (own(r'a: "x\0y"'), 'rcl cuts the text there'),
    'long name': (own('a' * 256 + ': 1'), 'bounds time and memory'),
    'deep group': (own('a: ' + '{a: ' * 2000 + '1' + '}' * 2000), 'bounds the recursion'),
    'large file': ('#' * (1 << 20) + '\n' + own('a: 1'), 'bounds time and memory'),
    'ros__parameters with a value, later': (
        own('a: 1') + 'linkage_node: {ros__parameters: 5}',
        'rcl sets the last parameter to it',
    ),
    'file of one word': ('hello', 'rcl takes it for the name of a node'),
}


def outcome(path, node='linkage_node'):
    """Returns the values and their types as text, or the error message.

    rcl ignores a file without parameters of the node; the reader refuses it.
    """
    try:
        return {
            name: repr(value)
            for name, value in read_parameter_file(path, node, for_ros=True).items()
        }
    except ConfigurationError as error:
        return {} if ' has no parameters of /' in str(error) else str(error)


@pytest.fixture(scope='module')
def files(tmp_path_factory):
    """Writes each case to a file, with its namespace, if any, in the name."""
    folder = tmp_path_factory.mktemp('parameters')
    texts = AGREED | {case: text for case, (text, _) in STRICTER.items()}
    for section, namespace in itertools.product((NODES + NAMESPACED).split(), NAMESPACES):
        texts[section, namespace] = own('a: 1', section)
    paths = {'directory': folder, 'missing': folder / 'missing.yaml'}
    for number, (case, text) in enumerate(texts.items()):
        paths[case] = folder / f'{number}.yaml'
        paths[case].write_bytes(text if isinstance(text, bytes) else text.encode())
    return paths


@pytest.fixture(scope='module')
def answers(files, tmp_path_factory):
    """Returns rcl's result for each file: its values, or the reason of the refusal."""
    folder = tmp_path_factory.mktemp('rcl')
    script = folder / 'read.py'
    script.write_text(RCL)
    # Without shared memory, whose locks a concurrent test may hold.
    variables = {'ROS_LOG_DIR': str(folder), 'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}
    todo, answers = list(files), {}
    while todo:
        pairs = [(files[case], case[1] if isinstance(case, tuple) else '') for case in todo]
        command = [sys.executable, script, folder / 'answers', *itertools.chain(*pairs)]
        run = subprocess.run(
            command, env={**os.environ, **variables}, capture_output=True, text=True,
            timeout=PATIENCE,
        )  # fmt: skip
        lines = (folder / 'answers').read_text().splitlines()
        answers.update(zip(todo, map(json.loads, lines), strict=False))
        if len(lines) < len(todo):
            assert run.returncode < 0, run.stderr
            answers[todo[len(lines)]] = f'rcl crashes with signal {-run.returncode}'
        todo = todo[len(lines) + 1 :]
    return answers


def agree(answer, mine):
    """Returns whether rcl and the reader both refuse a file, or both read the same values."""
    return isinstance(mine, str) if isinstance(answer, str) else mine == answer


def test_agrees_with_rcl(files, answers):
    disagreed = {}
    for case in [*AGREED, 'directory', 'missing']:
        mine = outcome(files[case])
        if not (
            isinstance(mine, str) if isinstance(answers[case], str) else mine == answers[case]
        ):
            disagreed[case] = answers[case], mine
    assert disagreed == {}


def test_refuses_what_rcl_misreads(files, answers):
    assert [case for case in STRICTER if not isinstance(answers[case], dict)] == []
    assert [case for case in STRICTER if not isinstance(outcome(files[case]), str)] == []


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / 'mine.yaml'
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


@pytest.mark.parametrize('namespace', NAMESPACES)
def test_agrees_with_rcl_in_a_namespace(namespace, files, answers):
    chosen = {case: path for case, path in files.items() if case[1] == namespace}
    read = {answers[case].get('a', '') for case in chosen if isinstance(answers[case], dict)}
    assert read == {'1', ''}  # only some sections belong to the node
    for case, path in chosen.items():
        assert agree(answers[case], outcome(path, f'{namespace}/linkage_node')), case


# Invalid values and names, and what the error names.
MESSAGES = {
    'a: []': "line 3: 'a'",
    'a: {b: [1, "x"]}': r"'a\.b' .* 1 .* 'x'",
    'a: [[1]]': "'a' .* list",
    'a: [{b: 1}]': "'a' .* mapping",
    'a:\nb: 1': "'a' ",
    'a: [1, ~, ]': " 1 .* '~'",
    '[a]: 1': 'name: value',
    '"": 1': "'' ",
    'a: &x 1\nb: *x': r'line 4: .*\*x',
    r'a: "x\0"': r"'x\\x00' ",
    'a' * 256 + ': 1': "'a{39} [.]{3} a{34}' .* 255 ",
    'a: b: c': 'line 3: ',
    'a: "x': 'YAML',
    'a: \x01': 'YAML',
}  # fmt: skip
# Mistakes of beginners, the line, and the corrected text.
COMMON = {
    'rpm: 1\n\tx: 1': 'line 4: ',
    'rpm:45.0': 'line 3: .*rpm: 45.0',
    'frame: {length:0.4, angle: 1}': 'line 3: .*length: 0.4',
    'frame: {length: 0,4}': 'line 3: .* 0.4',
    'gravity: [0.0, -9,81]': 'line 3: .* -9.81',
}  # fmt: skip
LAYOUT = {
    'x:\n  ros__parameters:\n    a: 1\n   b: 2': 'line 4: ',
    'hello': "line 1: 'hello'",
    '- 1': 'line 1: ',
    'linkage_node: {a: 1}': "'a' .*ros__parameters",
    'linkage_node:': "'linkage_node' ",
    'linkage_node: {ros__parameters: [1]}': "'ros__parameters' ",
    '/**:\n  ros_parameters:\n    mechanism: four_bar': "line 3: 'mechanism' .*ros__parameters",
    'ros__params: {a: 1}': "'a' .*ros__parameters",
}


@pytest.mark.parametrize(
    ('text', 'message'), [*((own(text), m) for text, m in MESSAGES.items()), *LAYOUT.items()]
)
def test_error_names_line_problem_and_cure(text, message, write):
    path = write(text)
    with pytest.raises(ConfigurationError, match=message) as caught:
        read_parameter_file(path)
    assert str(caught.value).startswith(f'{path}, line ')
    assert '\n' not in str(caught.value)
    assert len(str(caught.value)) < len(str(path)) + 200


@pytest.mark.parametrize(('text', 'message'), COMMON.items())
def test_common_mistake_is_described(text, message, write):
    with pytest.raises(ConfigurationError, match=message):
        read_parameter_file(write(own(text)))


def test_all_lines_with_common_mistakes_are_named_at_once(write):
    text = own(
        'a:1\n# b:1 0,1\nc: "x:1"\nd: [1,2,3]\ne: {f: 0,5}\n\tg: 1\nh: rerun+http://x:1/proxy'
    )
    with pytest.raises(ConfigurationError) as caught:
        read_parameter_file(write(text))
    assert re.findall(r'line (\d+): ', str(caught.value)) == ['3', '7', '8']


def test_log_is_not_taken_for_a_parameter_file(tmp_path):
    path = tmp_path / 'run.mcap'
    path.write_bytes(b'\x89MCAP0\r\n' + bytes(100))
    with pytest.raises(ConfigurationError, match=r'run\.mcap .*linkage_replay'):
        read_parameter_file(path)


def test_all_invalid_values_and_names_are_reported_at_once_with_the_file(write):
    path = write(
        own("""mechanism: four_bar
rmp: 45.0
frame: 0.4
crank: {length: "0,1", mass: -1.0}
coupler: {length: 0.4}
rocker: {length: 0.3 m}
rate_hz: 0.0""")
    )
    with pytest.raises(ConfigurationError) as caught:
        load(str(path))
    assert str(caught.value).startswith(f'{path}: 6 ')
    words = caught.value.__cause__.mistakes
    assert {one.split()[0].strip("'") for one in words} == {
        'rmp',
        'frame',
        'crank.length',
        'crank.mass',
        'rocker.length',
        'rate_hz',
    }
    assert 'frame: {length: ...}' in words[1]
    assert ' 0.1' in words[2]
    assert all(len(one) <= 600 for one in words)


@pytest.mark.parametrize(
    ('section', 'name', 'is_kept'),
    [
        ('/**', 'robot_name', False),
        ('/**', 'base_frame', False),
        ('/**', 'left_leg.crank.length', False),
        # A misspelt name, an old one, and one for this node alone are not those of others.
        ('/**', 'rmp', True),
        ('/**', 'cranks.length', True),
        ('/**', 'crank.robot_name', True),
        ('/**', 'friction.rocker', True),
        ('/**', 'use_sim_time', True),
        ('/**/linkage_node', 'robot_name', True),
        ('linkage_node', 'robot_name', True),
    ],
)
def test_names_of_other_programs_are_left_out_and_listed(section, name, is_kept, write):
    text = f'{section}: {{ros__parameters: {{rpm: 60.0, {name}: 1.0}}}}'
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter('always')
        values = read_own_parameters(write(text))
    assert {*values} == {'rpm', *[name] * is_kept}
    assert [name in str(one.message) for one in found] == [True] * (not is_kept)


def test_a_file_for_other_programs_alone_is_refused(write):
    with pytest.raises(ConfigurationError, match='robot_name'):
        read_own_parameters(write('/**: {ros__parameters: {robot_name: atlas}}'))


@pytest.mark.parametrize('wrong', [b'\xe9', b'\x01'])
def test_names_the_line_of_a_wrong_byte(wrong, write):
    path = write(b'\n' * 5000 + own('a: 1\nb: ').encode().rstrip(b'\n') + wrong + b'\n')
    with pytest.raises(ConfigurationError, match=', line 5004: '):
        read_parameter_file(path)


PIECES = st.sampled_from(
    [*'abc:,[]{}&*!|>?%@#"\'-.~\\/ \t\n\r\0', '\n  ', '\n    ', '\n      ', ': ', '- ', '---\n',
     'ros__parameters', 'linkage_node', '/**', '1', '1e2', '0x', '"\\U', '"\\u', 'FFFFFFFF',
     '!!str ', '%YAML 1.1\n---\n', '\ud7ff', '\ufeff', '\x85', '<<', 'é', '9' * 30, 'a: 1\n    ',
     'linkage_node:\n  ros__parameters:\n    ']
)  # fmt: skip
TEXTS = st.lists(PIECES, max_size=40).map(''.join)


@examples(50)
@given(st.one_of(TEXTS, TEXTS.map(own), st.text(), st.binary()))
def test_any_text_gives_values_or_one_line(tmp_path_factory, text):
    path = tmp_path_factory.getbasetemp() / 'any.yaml'
    path.write_bytes(text if isinstance(text, bytes) else text.encode('utf-8', 'surrogatepass'))
    mine = outcome(path)
    if isinstance(mine, str):
        starts = r', line \d+: .+; | is a log, | is not a text file: '
        assert re.fullmatch(rf'.*any\.yaml({starts}).+', mine)
    else:
        assert '[]' not in mine.values()
