"""What the words of a name say: evidence [log odds] for features such as "pressure", "rod side", "command".

A token counts as a whole; of a compound ("stangendruck") every stem of four letters and more counts, too. The lists are the
ordinary vocabulary of hydraulics in English and German, with the letters of formulae; a weight of 4 is a word that means one
thing, 1 a letter that may mean anything. What a name does not say is left to units, ranges and dynamics.
"""

from __future__ import annotations

import re
import unicodedata
from functools import lru_cache

FEATURES = {
    "angle": "angle:4 angular:1 winkel:4 theta:4 phi:2 alpha:1.5 q:1 q1:1 q2:1 pos:1 position:1.5 stellung:1.5 lage:1 "
    "roll:1.5 pitch:1.5 neigung:3 inclin:3 inclination:3 tilt:1.5 orient:2 encoder:2 geber:1 elevation:2 "
    "joint:0.5",
    "rate": "rate:4 gyro:4 omega:4 geschw:3 geschwindigkeit:3 winkelgeschw:4 winkelgeschwindigkeit:4 velocity:3 vel:3 "
    "speed:2 dot:2 dq:3 dtheta:4 qd:3 qp:2 thetadot:4 drehrate:4 angularvelocity:4 wz:2 wx:2 wy:2",
    "pressure": "pressure:4 druck:4 press:4 prs:4 pres:3 prss:3 p:1.5 hyd:0.5 transducer:1",
    "current": "current:4 strom:4 curr:4 ampere:4 amps:3 cur:3 i:1.5 solenoid:3 magnet:3 coil:3 spule:3 valve:1.5 "
    "ventil:1.5 pwm:1 y:0.5",
    "hose": "hose:4 schlauch:4 kolben:4 kolbenseite:4 piston:3 pistonside:4 bottom:3 boden:3 cap:3 capend:4 headend:1 "
    "bore:3 blind:3 base:2 a:1 large:1.5 gross:1.5 ks:1.5 bodenseite:4 basisend:3",
    "rod": "rod:4 rodside:4 rodend:4 stange:4 stangenseite:4 kolbenstange:4 ring:3 ringseite:4 ringraum:4 annulus:4 "
    "annular:4 gland:3 b:1 small:1.5 klein:1.5 ss:1.5",
    "extend": "extend:4 extension:4 ext:3 ausfahren:4 ausfahr:4 ausf:3 aus:2.5 out:2.5 heben:4 anheben:4 lift:3 raise:4 "
    "rais:3 raising:4 up:4 auf:3 hoch:3 pos:0.5 plus:2 boomup:4 hebe:4 hub:1",
    "retract": "retract:4 retraction:4 ret:3 rtr:2 einfahren:4 einfahr:4 einf:3 ein:2.5 in:1 senken:4 absenken:4 senk:4 "
    "lower:4 lowering:4 down:4 dn:3 ab:3 runter:3 tief:2 zu:1 minus:2 boomdown:4",
    "command": "command:4 cmd:4 soll:4 sollwert:4 setpoint:4 set:2.5 sp:2 ref:4 reference:4 target:4 desired:4 des:3 "
    "demand:4 dem:2 request:3 req:3 vorgabe:4 wanted:4 stell:2 fuehrung:3 commanded:4 input:1 u:0.5 "
    "joystick:4 lever:4 hebel:3",
    "measured": "measured:3 meas:3 actual:3 act:2 ist:3 istwert:3 feedback:3 fb:3 mess:2 gemessen:3 sensor:1 state:1 "
    "real:1",
    "boom": "boom:4 inner:2 main:1 ausleger:3 hauptausleger:4 hauptarm:4 hubarm:4 hubzylinder:3 hauptzylinder:3 "
    "lifting:1 first:1 luffing:4 wipp:3 liftcylinder:3",
    "other": "outer:4 aussen:4 knick:4 knickarm:4 knickarmzylinder:4 jib:4 arm:1 stick:4 dipper:4 bucket:4 loeffel:4 "
    "swing:4 slew:4 slewing:4 schwenk:4 drehwerk:4 telescope:4 tele:4 teleskop:4 grapple:4 greifer:4 "
    "gripper:4 rotator:4 track:4 engine:4 motor:3 diesel:4 swivel:4 outrigger:4 wrist:3 cabin:3 kabine:3 "
    "attachment:4 assist:4 wheel:4 steering:4 lenk:4 bremse:4 brake:4 ladder:3 winch:4 winde:4 crowed:3",
    "line": "supply:4 pump:4 pumpe:4 pumpen:4 versorgung:4 system:2 sys:2 tank:4 return:4 ruecklauf:4 pilot:4 "
    "vorsteuer:4 ls:3 loadsens:4 loadsensing:4 reservoir:4 accumulator:4 accu:3 speicher:4 leck:3 drain:4 "
    "ps:2 pt:2 pp:2 zulauf:4",
    "nothing": "temp:4 temperatur:4 temperature:4 voltage:4 spannung:4 batt:4 battery:4 flow:4 volumenstrom:6 "
    "durchfluss:4 force:4 kraft:4 torque:4 moment:4 mass:4 masse:4 weight:4 load:3 last:3 accel:4 acc:3 "
    "beschl:4 beschleunigung:4 gps:4 lat:3 lon:3 rpm:4 drehzahl:4 level:4 fuel:4 humidity:4 counter:4 count:3 "
    "idx:3 index:4 seq:4 crc:4 checksum:4 status:4 flag:4 error:4 fault:4 mode:4 variance:4 covariance:4 "
    "effort:4 quaternion:3 linear:3 length:3 laenge:3 stroke:3 weg:3 distance:3 noise:2 quality:3 enable:3 "
    "enabled:3 alive:3 residual:4",
}  # fmt: skip
_WEIGHTS: dict[str, list[tuple[str, float]]] = {}
for _feature, _words in FEATURES.items():
    for _entry in _words.split():
        _word, _, _weight = _entry.partition(":")
        _WEIGHTS.setdefault(_word, []).append((_feature, float(_weight)))
_STEMS = tuple(sorted((word for word in _WEIGHTS if len(word) >= 4), key=len, reverse=True))
_FORMULA = re.compile(r"^([piq])_?([a-z])$")  # pa, ib: the quantity and its side
_SPLIT = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
_UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ß": "ss"})


def tokens(name: str) -> list[str]:
    """The words of a name in small letters: snake_case, camelCase and digits are separated, umlauts written out."""
    plain = unicodedata.normalize("NFKD", name.translate(_UMLAUTS)).encode("ascii", "ignore").decode()
    return [word.lower() for word in _SPLIT.findall(plain)]


@lru_cache(maxsize=8192)
def features(name: str) -> dict[str, float]:
    """Feature -> evidence [log odds] of the words of a name; of several words for one feature the strongest counts."""
    found: dict[str, float] = {}
    for token in tokens(name):
        for word in _known(token):
            for feature, weight in _WEIGHTS[word]:
                found[feature] = max(found.get(feature, 0.0), weight)
    if found.get("rate", 0.0) >= 2.0:  # "winkelgeschwindigkeit", "angular velocity", "joint rate"
        found.pop("angle", None)
    if found.get("rod", 0.0) >= 3.0 and found.get("hose", 0.0) <= 4.0:  # "kolbenstange", "piston rod"
        found.pop("hose", None)
    return found


def _known(token: str) -> list[str]:
    if token in _WEIGHTS:
        return [token]
    formula = _FORMULA.match(token)
    if formula:
        side = {"h": "hose", "r": "rod", "k": "kolben"}.get(formula[2], formula[2])
        return [word for word in (formula[1], side) if word in _WEIGHTS]
    result, rest = [], token
    for stem in _STEMS:
        if stem in rest:
            result.append(stem)
            rest = rest.replace(stem, " ")
    return result
