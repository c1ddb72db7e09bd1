"""Codes of the outer shape of a file: text, YAML, size."""

from __future__ import annotations

from lagcli.errors.catalogue.page import Page

_SMALLEST = """\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
"""

PAGES = (
    Page(
        code="not-a-file",
        stage="input",
        meaning="The path names a directory.",
        why="A model is one file; which file of a directory is meant is not guessed.",
        example="lagcli dof models/",
        cure="Name the file.",
        new="lagcli dof models/pendulum.yaml",
    ),
    Page(
        code="not-text",
        stage="input",
        meaning="The file holds bytes that are not UTF-8 text, or control characters.",
        why="A model file is plain text. Binary files, compressed files and text in other encodings cannot be"
        " read as one, and a guess at the encoding could change a name.",
        example="lagcli check model.yaml.gz",
        cure="Give the text file itself, saved as UTF-8.",
        new="gunzip model.yaml.gz && lagcli check model.yaml",
    ),
    Page(
        code="too-large",
        stage="input",
        meaning="The file is larger than 32 MiB, or holds more than two million entries.",
        why="The size of what is read is bounded, so that a wrong or hostile file cannot use up the memory.",
        example="lagcli check measured-positions.yaml    # 80 MB of numbers",
        cure="Keep data out of the model: a model states laws and initial values.",
    ),
    Page(
        code="too-large-to-build",
        stage="input",
        meaning="The model has more particles, coordinates or rows than its equations are built for, or a step of it"
        " would take too much memory.",
        why="A file of a few lines could otherwise take all memory of a machine. Free particles under constant forces"
        " are counted however many they are; a run is refused where it would take more than 2 GB.",
        example="lagcli simulate models/million-links.yaml",
        cure="Model fewer members.",
        new="lagcli simulate models/million-links.yaml --set N=1000",
    ),
    Page(
        code="too-large-to-derive",
        stage="input",
        meaning="An expression, or the kinetic energy of dependent particles, is too long to be written out as"
        " equations.",
        why="`derive` writes equations for a person to read. Beyond some thousand terms nobody reads them, and"
        " computer algebra would need minutes or more. `check` and `simulate` do not write equations out and"
        " have no such limit.",
        example="lagcli derive models/hundred-angles.yaml    # a chain of a hundred dependent particles",
        cure="Derive a smaller member of the same kind, or write the model in Cartesian particles with rows,"
        " whose equations have bounded length.",
        new="lagcli derive models/hundred-angles.yaml --set N=3",
    ),
    Page(
        code="too-many-errors",
        stage="input",
        meaning="The file has a thousand errors or more, and no further ones were looked for.",
        why="So many errors have few causes, most often one misspelt name that is used everywhere, or a file that"
        " is no model.",
        example="lagcli check thousand-links.yaml    # where the parameter `L` is missing",
        cure="Correct the first errors and run again.",
    ),
    Page(
        code="empty-model",
        meaning="The file holds nothing, or comments only.",
        why="A model has at least the version of the format and something that can move.",
        example="# a model will be here\n",
        cure="Begin with the version, then declare particles or coordinates.",
        new=_SMALLEST,
    ),
    Page(
        code="not-a-mapping",
        meaning="A list or a plain text is written where names and values are needed.",
        why="A model is a mapping of sections, and most sections are mappings from the names you choose to what"
        " they stand for. Without names there is nothing to call a column or an error by.",
        example="""\
lagcli: 1
particles:
  - {mass: 1, position: [1, 0, 0]}
""",
        cure="Give each entry a name and a colon instead of a dash.",
        old="- {",
        new="a: {",
    ),
    Page(
        code="bad-key",
        meaning="A key is a list or a mapping.",
        why="Keys are names of sections, fields or things, so they are plain texts. In flow style an unquoted"
        " bracket makes a list of what was meant as a text.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
outputs:
  [height]: a.z
""",
        cure="Write the name alone.",
        old="[height]",
        new="height",
    ),
    Page(
        code="duplicate-key",
        meaning="The same key occurs twice in one mapping.",
        why="YAML would silently let the second win, and half of what you wrote would be lost.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
forces:
  pull: {to: a, force: [1, 0, 0]}
  pull: {to: a, force: [0, 0, 1]}
""",
        cure="Rename or remove one of them.",
        old="pull: {to: a, force: [0",
        new="lift: {to: a, force: [0",
    ),
    Page(
        code="yaml-syntax",
        meaning="The text is not well-formed YAML, so its structure cannot be seen.",
        why="Frequent causes are a text with brackets or commas inside `{ }` or `[ ]` without quotes, a text with"
        " `: ` or ` #` without quotes, a tab used as indent, and a bracket that is never closed.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
forces:
  pull: {to: a, force: [1, 0, 0]*2}
""",
        cure="Put the text in quotes.",
        old="[1, 0, 0]*2",
        new='"[1, 0, 0]*2"',
    ),
    Page(
        code="several-documents",
        meaning="The file holds more than one YAML document (a line `---` after the first).",
        why="A file is one model. Two in one file would leave open which one is meant.",
        example=_SMALLEST + "---\n" + _SMALLEST,
        cure="Keep one model in one file.",
        old="---\n" + _SMALLEST,
    ),
    Page(
        code="yaml-alias",
        meaning="The file uses a YAML anchor (`&name`) or alias (`*name`).",
        why="Aliases can make a short file stand for an enormous one, and they hide what an entry says. A text"
        " that begins with `&` or `*` by chance needs quotes.",
        example="""\
lagcli: 1
particles:
  a: {mass: &m 2, position: [1, 0, 0]}
""",
        cure="Use a parameter for a value that occurs more than once.",
        old="particles:\n  a: {mass: &m 2",
        new="parameters: {m: 2}\nparticles:\n  a: {mass: m",
    ),
    Page(
        code="yaml-tag",
        meaning="The file uses a YAML tag such as `!!python/object` or `!!float`.",
        why="Tags tell a YAML library to build objects, which a stranger's file must not be able to do. Every value"
        " is read from its text, so tags are never needed.",
        example="""\
lagcli: 1
particles:
  a: {mass: !!float 1, position: [1, 0, 0]}
""",
        cure="Leave the tag out.",
        old="!!float ",
    ),
    Page(
        code="too-deep",
        meaning="Brackets, parentheses or indents nest deeper than any sensible model needs.",
        why="Depth is bounded, so that no file can exhaust the stack of the program: 16 levels of YAML, 40 levels"
        " of parentheses, signs and powers in an expression.",
        example=f"""\
lagcli: 1
particles:
  a: {{mass: "{"(" * 41}1{")" * 41}", position: [1, 0, 0]}}
""",
        cure="Remove what is not needed, or name parts of a large formula under `definitions`.",
        old="(" * 41 + "1" + ")" * 41,
        new="1",
    ),
)
