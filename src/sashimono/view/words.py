"""The words of the instructions and of ways in, in each language. A language is one more entry of `LANGUAGES`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.fasteners.recognise import Fastener
from sashimono.fasteners.sizes import nominal_width
from sashimono.geometry.legs import Leg, main_leg, simple_legs


@dataclass(frozen=True, kw_only=True)
class Words:
    """All that the instructions say in one language; braces are filled in."""

    code: str
    manual: str
    contents: str
    parts: str
    tools: str
    number: str
    part: str
    quantity: str
    size: str
    kind: str
    product: str
    subassembly: str
    step: str
    start: str
    """Of a base that stands on the table."""
    start_in_fixture: str
    place: str
    """Of a part without a way in: it stands there from the beginning."""
    through: str
    """What a fastener goes through."""
    into: str
    """What it goes into."""
    on: str
    """What a nut or washer is put on."""
    tighten: str
    """After the way of a screw, bolt or nut that is drawn without a thread."""
    down: str
    up: str
    along: str
    turns: str
    one_turn: str
    clockwise: str
    counter_clockwise: str
    turn: str
    """Less than a turn, about the way."""
    tilt: str
    """About another axis."""
    then: str
    times: str
    tool: str
    gripper: str
    no_gripper: str
    hold: str
    keep: str
    let_go: str
    simultaneous: str
    """Of parts that go in at the same time, each at constant speed."""
    with_others: str
    """The same, of one of them that has a step of its own."""
    hands: str
    still_held: str
    """Of parts that must be held when all is done."""
    turn_over: str
    turn_product: str
    """Of the product, so that the task is done on another table."""
    hold_turned: str
    turn_chapter: str
    no_room: str
    """Where a tool has no room."""
    no_contact: str
    declared: str
    gives: str
    """Where an elastic part has to give on the way."""
    fitted: str
    unsolved: str
    unsolved_part: str
    partial: str
    not_executable: str
    together: str
    steps_of_plan: str
    pictures: str
    """Before what their colours mean."""
    coming: str
    ends: str
    held: str
    glass: str
    kinds: dict[str, str]
    drives: dict[str, str]
    decimal: str = "."
    comma: str = ", "
    stop: str = "."
    """At the end of a sentence."""


ENGLISH = Words(
    code="en",
    manual="Assembly instructions",
    contents="Steps",
    parts="Parts",
    tools="Tools",
    number="No.",
    part="Part",
    quantity="Quantity",
    size="Size",
    kind="Kind",
    product="Final assembly",
    subassembly="Subassembly {letter}",
    step="Step {number}",
    start="Put {part} on the table as shown.",
    start_in_fixture="Hold {part} in a fixture, its lowest point {height} above the table.",
    place="{part} stands there from the beginning.",
    through="through {parts}",
    into="into {parts}",
    on="on {parts}",
    tighten="Tighten",
    down="down {length}",
    up="up {length}",
    along="{length} along the arrow",
    turns="{count} turns {hand}",
    one_turn="{count} turn {hand}",
    clockwise="clockwise",
    counter_clockwise="counter-clockwise",
    turn="turn {angle} {hand}",
    tilt="tilt by {angle}",
    then=", then ",
    times="{count} × {part}",
    tool="Tool",
    gripper="Gripper",
    no_gripper="none of those asked about",
    hold="Hold {parts} so that nothing falls or tips.",
    keep="Keep holding {parts}.",
    let_go="Let go of {parts}.",
    simultaneous="All of them at the same time: each starts with the others and ends with them.",
    with_others="At the same time as {parts}: start together and end together.",
    hands="Needs {count} hands at once.",
    still_held="The drawing shows nothing that holds {parts}: fasten before you let go.",
    turn_over="Turn subassembly {letter} as shown before you bring it.",
    turn_product="Turn all that is put together over, so that it stands as shown.",
    hold_turned="Then hold {parts} so that nothing falls or tips.",
    turn_chapter="Put together beside the product, this side up.",
    no_room="No room for the tool ({tool}) with these parts in place.",
    no_contact="The plan has no grasp here: place by hand.",
    fitted="The drawing shows no clearance at {parts}: it is taken to stay where it is pushed.",
    declared="The drawing shows no thread: the turns are those of a standard right-hand thread.",
    gives="{part} has to give way, by up to {depth} mm.",
    unsolved="Parts without instructions",
    unsolved_part="{part}: no way in was found.",
    partial="{count} parts have no instructions: see the last page.",
    not_executable="Some steps need more than {hands} hands, or a grasp that the plan has not: see the warnings.",
    together="Subassembly {letter}",
    steps_of_plan="steps of the plan",
    pictures="In the pictures",
    coming="comes in this step",
    ends="where it ends",
    held="held by hand or in a fixture",
    glass="in the way of the view, drawn as glass",
    kinds={
        "screw": "screw", "bolt": "bolt", "nut": "nut", "washer": "washer", "pin": "pin", "standoff": "standoff",
        "circlip": "circlip",
    },
    drives={
        "hex socket": "hex key {size} mm", "hex": "wrench {size} mm", "cross": "screwdriver (cross)",
        "slot": "screwdriver (slot)", "six-lobe": "screwdriver (six-lobe)",
    },
)  # fmt: skip

GERMAN = Words(
    code="de",
    manual="Montageanleitung",
    contents="Schritte",
    parts="Stückliste",
    tools="Werkzeuge",
    number="Nr.",
    part="Teil",
    quantity="Anzahl",
    size="Größe",
    kind="Art",
    product="Endmontage",
    subassembly="Baugruppe {letter}",
    step="Schritt {number}",
    start="{part} wie gezeigt auf den Tisch stellen.",
    start_in_fixture="{part} in einer Vorrichtung halten, der tiefste Punkt {height} über dem Tisch.",
    place="{part} steht von Anfang an da.",
    through="durch {parts}",
    into="in {parts}",
    on="auf {parts}",
    tighten="Festziehen",
    down="{length} nach unten",
    up="{length} nach oben",
    along="{length} entlang des Pfeils",
    turns="{count} Umdrehungen {hand}",
    one_turn="{count} Umdrehung {hand}",
    clockwise="im Uhrzeigersinn",
    counter_clockwise="gegen den Uhrzeigersinn",
    turn="{angle} {hand} drehen",
    tilt="um {angle} kippen",
    then=", dann ",
    times="{count} × {part}",
    tool="Werkzeug",
    gripper="Greifer",
    no_gripper="keiner der gefragten",
    hold="{parts} festhalten, damit nichts fällt oder kippt.",
    keep="{parts} weiter festhalten.",
    let_go="{parts} loslassen.",
    simultaneous="Alle zugleich: zusammen anfangen und zusammen ankommen.",
    with_others="Zugleich mit {parts}: zusammen anfangen und zusammen ankommen.",
    hands="Braucht {count} Hände zugleich.",
    still_held="Die Zeichnung zeigt nichts, was {parts} hält: vor dem Loslassen befestigen.",
    turn_over="Baugruppe {letter} vor dem Einsetzen wie gezeigt drehen.",
    turn_product="Alles Zusammengebaute umdrehen, sodass es wie gezeigt steht.",
    hold_turned="Dann {parts} halten, damit nichts fällt oder kippt.",
    turn_chapter="Neben dem Produkt zusammenbauen, diese Seite oben.",
    no_room="Kein Platz für das Werkzeug ({tool}), solange diese Teile da sind.",
    no_contact="Der Plan hat hier keinen Griff: von Hand einsetzen.",
    fitted="Die Zeichnung zeigt kein Spiel gegen {parts}: angenommen ist, dass es bleibt, wohin es geschoben wird.",
    declared="Die Zeichnung zeigt kein Gewinde: die Umdrehungen sind die eines üblichen Rechtsgewindes.",
    gives="{part} muss nachgeben, um bis zu {depth} mm.",
    unsolved="Teile ohne Anleitung",
    unsolved_part="{part}: kein Weg hinein gefunden.",
    partial="{count} Teile haben keine Anleitung: siehe letzte Seite.",
    not_executable="Manche Schritte brauchen mehr als {hands} Hände oder einen Griff, den der Plan nicht hat: "
    "siehe Warnungen.",
    together="Baugruppe {letter}",
    steps_of_plan="Schritte des Plans",
    pictures="In den Bildern",
    coming="kommt in diesem Schritt",
    ends="wo es endet",
    held="von Hand oder in einer Vorrichtung gehalten",
    glass="verdeckt die Sicht, als Glas gezeichnet",
    kinds={
        "screw": "Schraube", "bolt": "Bolzen", "nut": "Mutter", "washer": "Scheibe", "pin": "Stift",
        "standoff": "Abstandsbolzen", "circlip": "Sicherungsring",
    },
    drives={
        "hex socket": "Innensechskant {size} mm", "hex": "Schraubenschlüssel {size} mm",
        "cross": "Kreuzschlitz-Schraubendreher", "slot": "Schlitz-Schraubendreher",
        "six-lobe": "Innensechsrund-Schraubendreher",
    },
    decimal=",",
)  # fmt: skip

JAPANESE = Words(
    code="ja",
    manual="組立説明書",
    contents="手順",
    parts="部品表",
    tools="工具",
    number="番号",
    part="部品",
    quantity="数量",
    size="寸法",
    kind="種類",
    product="最終組立",
    subassembly="サブアセンブリ{letter}",
    step="手順{number}",
    start="{part}を図のように台に置きます。",
    start_in_fixture="{part}を治具で支えます。最下点は台から{height}上です。",
    place="{part}は最初からそこにあります。",
    through="{parts}を通し",
    into="{parts}へ",
    on="{parts}に",
    tighten="締め付け",
    down="下へ{length}",
    up="上へ{length}",
    along="矢印に沿って{length}",
    turns="{hand}に{count}回転",
    one_turn="{hand}に{count}回転",
    clockwise="時計回り",
    counter_clockwise="反時計回り",
    turn="{hand}に{angle}回す",
    tilt="{angle}傾ける",
    then="、次に",
    times="{part} × {count}",
    tool="工具",
    gripper="グリッパ",
    no_gripper="該当なし",
    hold="{parts}を支え、落下や転倒を防ぎます。",
    keep="{parts}を支え続けます。",
    let_go="{parts}から手を離します。",
    simultaneous="すべて同時に動かします。同時に始め、同時に終えます。",
    with_others="{parts}と同時に動かします。同時に始め、同時に終えます。",
    hands="同時に{count}本の手が必要です。",
    still_held="図面には{parts}を固定するものがありません。手を離す前に固定してください。",
    turn_over="サブアセンブリ{letter}を図の向きに回してから取り付けます。",
    turn_product="組み立てたものを裏返し、図のように置きます。",
    hold_turned="その後、落ちたり倒れたりしないように{parts}を押さえます。",
    turn_chapter="製品の横で、この面を上にして組み立てます。",
    no_room="これらの部品があると工具（{tool}）が入りません。",
    no_contact="この部品の把持は計画にありません。手で取り付けてください。",
    fitted="図面では{parts}との間にすき間がありません。押し込んだ位置にとどまるものとします。",
    declared="図面にねじ山がありません。回転数は標準の右ねじによります。",
    gives="{part} がたわみます(最大 {depth} mm)。",
    unsolved="手順のない部品",
    unsolved_part="{part}：組み込む経路が見つかりませんでした。",
    partial="{count}個の部品には手順がありません。最後のページを見てください。",
    not_executable="{hands}本を超える手、または計画にない把持が必要な手順があります。警告を見てください。",
    together="サブアセンブリ{letter}",
    steps_of_plan="計画の手順",
    pictures="図の色",
    coming="この手順で取り付ける部品",
    ends="取り付け位置",
    held="手または治具で支える部品",
    glass="視界をさえぎるため透明に描いた部品",
    kinds={
        "screw": "ねじ", "bolt": "ボルト", "nut": "ナット", "washer": "座金", "pin": "ピン",
        "standoff": "スペーサ", "circlip": "止め輪",
    },
    drives={
        "hex socket": "六角レンチ {size} mm", "hex": "スパナ {size} mm", "cross": "プラスドライバ",
        "slot": "マイナスドライバ", "six-lobe": "ヘクスローブドライバ",
    },
    comma="、",
    stop="。",
)  # fmt: skip

LANGUAGES = {words.code: words for words in (ENGLISH, GERMAN, JAPANESE)}
"""By code, as ``--language`` takes it."""


def length_words(length: float, words: Words) -> str:
    """Return a length [m] in millimetres, with as many digits as a hand needs."""
    value = 1e3 * length
    digits = 0 if value >= 9.95 else 1 if value >= 0.95 else 2 if value >= 0.095 else 3
    return f"{value:.{digits}f}".replace(".", words.decimal) + " mm"


def size_words(size: Float[np.ndarray, "3"], words: Words) -> str:
    """Return the edges of a box [m] in millimetres."""
    values = [1e3 * float(edge) for edge in size]
    texts = [f"{value:.0f}" if value >= 9.95 else f"{value:.2g}" for value in values]
    return " × ".join(texts).replace(".", words.decimal) + " mm"


def leg_words(
    leg: Leg,
    up: Float[np.ndarray, "3"],
    words: Words,
    *,
    way: Float[np.ndarray, "3"] | None = None,
    arrow: bool = False,
) -> str:
    """Return one leg of a way in words: "down 16 mm", "4 turns clockwise", "tilt by 12°".

    Args:
        leg: The leg.
        up: Away from the table.
        words: The language.
        way: Which way the part goes on the whole: turns about it have a hand, seen along it. The leg's own if None.
        arrow: Whether the words stand beside an arrow, which then need not be named.
    """
    rise = float(leg.direction @ up)
    along = "{length}" if arrow else words.along
    template = words.down if rise < -0.966 else words.up if rise > 0.966 else along
    travel = template.format(length=length_words(leg.length, words))
    if leg.straight:
        return travel
    about = 1.0 if way is None else float(leg.direction @ way)
    turns = leg.turns if about >= 0.0 else -leg.turns
    hand = words.clockwise if turns > 0.0 else words.counter_clockwise
    count = abs(turns)
    if 360.0 * count < 0.5 and leg.length > 0.0:
        return travel
    if count < 0.75:
        template = words.turn if abs(about) > 0.9 else words.tilt
        turning = template.format(angle=f"{360.0 * count:.0f}°", hand=hand)
    else:
        text = f"{count:.0f}" if abs(count - round(count)) < 0.05 else f"{count:.1f}".replace(".", words.decimal)
        turning = (words.one_turn if text == "1" else words.turns).format(count=text, hand=hand)
    return f"{turning} ({travel})" if leg.length > 0.0 else turning


def way_lines(
    legs: Sequence[Leg], up: Float[np.ndarray, "3"], words: Words, *, arrow: bool = False, most: int = 4
) -> list[str]:
    """Return a whole way in words, a line a leg; of a way of many legs the last ones. None of no legs."""
    told = simple_legs(legs)
    leading = main_leg([leg for leg in told if leg.length > 0.0])
    way = None if leading is None else leading.direction
    lines = [leg_words(leg, up, words, way=way, arrow=arrow) for leg in told[-most:]]
    return ["…", *lines] if len(told) > most else lines


def way_words(legs: Sequence[Leg], up: Float[np.ndarray, "3"], words: Words) -> str:
    """Return a whole way in a sentence without its stop; see `way_lines`."""
    return words.then.join(way_lines(legs, up, words))


def tool_words(fastener: Fastener, words: Words) -> str | None:
    """Return what turns a fastener: "hex key 3 mm"; None if it has no drive."""
    if fastener.drive not in words.drives:
        return None
    width = nominal_width(fastener.drive_size, key=fastener.drive == "hex socket")
    return words.drives[fastener.drive].format(size=f"{width:g}".replace(".", words.decimal))


def names_words(names: Sequence[str], words: Words, most: int = 4) -> str:
    """Return some names, and how many more there are."""
    text = words.comma.join(names[:most])
    return text if len(names) <= most else f"{text} +{len(names) - most}"
