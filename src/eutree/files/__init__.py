"""All reading and writing of files: atomic, versioned, checked, without pickle."""

from eutree.files.arrays import read_archive, read_arrays, write_archive, write_arrays
from eutree.files.atomic import (
    check_new_folder,
    check_writable,
    locked,
    make_folder,
    opened_text,
    read_bytes,
    write_bytes,
    write_text,
)
from eutree.files.documents import Document, read_document, write_document

__all__ = [
    "Document", "check_new_folder", "check_writable", "locked", "make_folder", "opened_text",
    "read_archive", "read_arrays", "read_bytes", "read_document", "write_archive", "write_arrays",
    "write_bytes", "write_document", "write_text",
]  # fmt: skip
