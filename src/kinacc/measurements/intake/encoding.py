"""In which characters a text file is written: by what decodes, and then by what makes sense."""

from __future__ import annotations

import codecs
from pathlib import Path

_CHUNK, _SAMPLE = 1 << 20, 200_000
# Lead bytes of the Japanese that is written every day; few of them are letters in the West.
_USUAL_LEADS = range(0x81, 0xA0)


def encoding_of(path: Path) -> str:
    """One of ``written.ENCODINGS``."""
    with open(path, "rb") as file:
        head = file.read(4096)
        if head.startswith(codecs.BOM_UTF16_LE):
            return "utf-16-le"
        if head.startswith(codecs.BOM_UTF16_BE):
            return "utf-16-be"
        if wide := _without_mark(head):
            return wide
        file.seek(0)
        decoder = codecs.getincrementaldecoder("utf-8")("strict")
        try:
            while chunk := file.read(_CHUNK):
                decoder.decode(chunk)
            decoder.decode(b"", final=True)
            return "utf-8"
        except UnicodeDecodeError:
            file.seek(0)
            return _national(_lines_of_interest(file))


def _without_mark(head: bytes) -> str:
    """UTF-16 that does not say so: nearly every second byte of a table of numbers is zero."""
    even, odd = head[0::2], head[1::2]
    if odd and odd.count(0) > 0.7 * len(odd) and even.count(0) < 0.1 * len(even):
        return "utf-16-le"
    if odd and even.count(0) > 0.7 * len(even) and odd.count(0) < 0.1 * len(odd):
        return "utf-16-be"
    return ""


def _lines_of_interest(file) -> bytes:
    """Lines with bytes that are not ASCII, up to a length that says enough."""
    sample = bytearray()
    for line in file:
        if not line.isascii():
            sample += line[:_SAMPLE]
        if len(sample) > _SAMPLE:
            break
    return bytes(sample)


def _national(sample: bytes) -> str:
    """Japanese where the bytes are pairs that begin as its usual characters do, else Western."""
    try:
        sample.decode("cp932")
    except UnicodeDecodeError as error:
        if error.start < len(sample) - 2:
            return "latin-1"
    usual = pairs = place = 0
    while place < len(sample):
        lead = sample[place]
        if lead < 0x80 or 0xA0 <= lead <= 0xDF:
            place += 1
            continue
        pairs += 1
        usual += lead in _USUAL_LEADS
        place += 2
    return "cp932" if pairs and 2 * usual >= pairs else "latin-1"
