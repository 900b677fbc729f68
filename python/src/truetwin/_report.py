"""Reports for notebooks."""

from __future__ import annotations

import html
import os
from dataclasses import dataclass

from ._errors import TruetwinError
from ._names import word


@dataclass(frozen=True, repr=False)
class Report:
    """What the program reports for people. A notebook shows the page or the pictures; ``print`` shows the text.

    Attributes
    ----------
    text : str
        The text that the command line prints.
    page : str or None
        A whole HTML page, if the verb writes one.
    pictures : tuple of str
        SVG pictures, one for each record.
    """

    text: str
    page: str | None = None
    pictures: tuple[str, ...] = ()

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return self.text

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the report as an HTML page.

        Parameters
        ----------
        path : path
            File to write; an existing one is replaced.
        """
        name = word(path)
        body = f'<!doctype html><meta charset="utf-8"><title>truetwin</title>{self._body()}'
        try:
            with open(name, "w", encoding="utf-8") as file:
                file.write(self.page or body)
        except OSError as error:
            raise TruetwinError(f"{name}: {error.strerror}; give a file that can be written") from error

    def _repr_html_(self) -> str:
        if self.page is None:
            return self._body()
        # In a frame of its own: neither the styles of the page nor those of the notebook reach the other one.
        page = html.escape(self.page, quote=True)
        return f'<iframe srcdoc="{page}" title="truetwin" style="width:100%;height:40rem;border:0" sandbox="allow-scripts"></iframe>'

    def _body(self) -> str:
        return "".join(self.pictures) + f"<pre>{html.escape(self.text)}</pre>"
