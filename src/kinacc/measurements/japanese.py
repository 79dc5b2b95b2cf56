"""Japanese names of columns in the English words that the other names are read by."""

from __future__ import annotations

import re

_TEXT = """
関節角度 joint|関節角 joint|関節 joint|ジョイント joint|第 |軸角度 axis|軸 axis|角度 angle
位置 position|座標値 coordinate|座標 coordinate|姿勢 orientation|回転 rotation|回転角 rotation
測定点名 point|測定点番号 point|測定点 point|点番号 point|点名 point|ポイント point|点 point
測定値 measured|測定 measured|計測値 measured|計測 measured|実測値 measured|実測 measured
トラッカー tracker|トラッカ tracker|リフレクター reflector|リフレクタ reflector|反射鏡 reflector
指令値 command|指令 command|目標値 target|目標 target|教示 taught|公称値 nominal|公称 nominal
設計値 design|設計 design|理論値 theoretical|理論 theoretical|現在値 actual|現在 actual
実績値 actual|実績 actual|偏差 deviation|誤差 error|差分 difference|標準偏差 std
不確かさ uncertainty|温度 temperature|時刻 time|時間 time|日時 time|番号 no|繰り返し repeat
繰返し repeat|半径 radius|直径 diameter|速度 velocity|加速度 acceleration|電流 current
トルク torque|ロボット robot|コントローラ controller|ツール tool|手先 tcp|度 deg
ラジアン rad|ミリメートル mm|ミリ mm|メートル m|パルス pulse|℃ °C|㎜ mm
"""
_WORDS = {
    japanese: english.strip()
    for line in _TEXT.split("\n")
    for japanese, _, english in (pair.partition(" ") for pair in line.split("|") if pair)
}
_ANY = re.compile("|".join(sorted(map(re.escape, _WORDS), key=len, reverse=True)))
_WIDE = {code: code - 0xFEE0 for code in range(0xFF01, 0xFF5F)} | {0x3000: " "}


def in_english(text: str) -> str:
    """The text with known Japanese words in English, and full-width signs as ordinary ones."""
    if text.isascii():
        return text
    return _ANY.sub(lambda found: f" {_WORDS[found[0]]} ", text.translate(_WIDE))
