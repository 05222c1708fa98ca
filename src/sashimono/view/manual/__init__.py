"""Work instructions: what a person needs to put the product together by hand, as one page to read or to print."""

from sashimono.view.manual.content import BillRow, bill_of_materials, make_manual
from sashimono.view.manual.page import write_manual
from sashimono.view.manual.pdf import find_browser, print_page
from sashimono.view.words import LANGUAGES

__all__ = [
    "LANGUAGES",
    "BillRow",
    "bill_of_materials",
    "find_browser",
    "make_manual",
    "print_page",
    "write_manual",
]
