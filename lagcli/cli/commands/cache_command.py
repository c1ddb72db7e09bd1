"""`lagcli cache`: the native code that is kept for later runs."""

from __future__ import annotations

from typing import Annotated

from lagcli.cli.commands import options


@options.command()
def cache(
    clear: Annotated[bool, "delete what is kept"] = False,
    as_json: Annotated[bool, "JSON on standard output"] = False,
) -> None:
    """Print the folder in which native code is kept for later runs, its size and its age, or empty it.

    Nothing but time depends on it: it may be deleted while programs run. LAGCLI_CACHE names another folder.
    """
    from lagcli.native import object_folder
    from lagcli.output.files import formats

    if clear:
        object_folder.clear()
    contents = object_folder.contents()
    if as_json:
        print(formats.json_line(contents.as_json()))
    elif contents.folder is None:
        print("no folder: the system names no home, and LAGCLI_CACHE none either")
    else:
        print(f"folder  {contents.folder}")
        print(f"files   {contents.files}")
        print(f"size    {contents.size / 2**20:.1f} MB of at most {object_folder.MOST_BYTES / 2**20:.0f}")
        if contents.files:
            print(f"age     {contents.age / 86400:.1f} days since the oldest was used")
