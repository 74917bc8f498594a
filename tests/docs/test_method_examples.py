"""The examples in the docstrings of methods: pytest finds none of classes that a private module defines."""

import inspect
from doctest import NORMALIZE_WHITESPACE, DocTestParser, DocTestRunner

import dynhull


def test_the_examples_of_methods_are_right() -> None:
    runner = DocTestRunner(optionflags=NORMALIZE_WHITESPACE)
    classes = {
        base
        for value in map(dynhull.__dict__.get, dynhull.__all__)
        if inspect.isclass(value)
        for base in value.__mro__
        if base.__module__.startswith("dynhull")
    }
    for each in classes:
        for name, member in vars(each).items():
            text = inspect.getdoc(member) if callable(member) or isinstance(member, property) else None
            if text and ">>>" in text:
                runner.run(DocTestParser().get_doctest(text, {}, f"{each.__name__}.{name}", None, None))
    assert runner.tries > 0
    assert runner.failures == 0
