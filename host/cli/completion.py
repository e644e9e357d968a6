"""Print what has a shell complete commands, options and names after a tab.

examples:
  cubestack completion bash > ~/.local/share/bash-completion/completions/cubestack
  cubestack completion zsh > ~/.zfunc/_cubestack        (with fpath+=~/.zfunc in ~/.zshrc)
  cubestack completion fish > ~/.config/fish/completions/cubestack.fish
"""

import argparse

import shtab


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=("bash", "zsh", "fish"), help="whose completion")


def run(args: argparse.Namespace) -> int:
    from cubestack.host.cli.main import make_parser  # it loads this module

    print(shtab.complete(make_parser(), args.shell))
    return 0
