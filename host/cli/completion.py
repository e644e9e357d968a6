"""Print the script that completes commands, options and names in a shell.

examples:
  cubestack completion bash > ~/.local/share/bash-completion/completions/cubestack
  cubestack completion zsh > ~/.zfunc/_cubestack        (with fpath+=~/.zfunc in ~/.zshrc)
  cubestack completion fish > ~/.config/fish/completions/cubestack.fish
"""

import argparse

import shtab


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=("bash", "zsh", "fish"), help="shell to complete for")


def run(args: argparse.Namespace) -> int:
    from cubestack.host.cli.main import make_parser  # it loads this module

    print(shtab.complete(make_parser(), args.shell))
    return 0
