# This program runs on the hub, under Pybricks' MicroPython; the driver uploads it as joshua_hub.mpy.
#
# Lines are ASCII: KIND SEQUENCE[,ARGUMENT...]*CRC, such as "T1f,-12,90*8d02". SEQUENCE is two hexadecimal
# digits, CRC is CRC-16/CCITT-FALSE of all before the star. The hub speaks only when it is spoken to, so that
# it never waits for room in its output, and its dead man's switch never waits for that.
#
# It keeps to what Pybricks' MicroPython has: no encode, no decode, no partition.
#
#   ?               who is there                        R seq,HASH,millivolts
#   C ms,H|F,AB     dead-man time, its action, ports    M seq,A:48,B:0  (device ids; 0 nothing, - no motor)
#   E               torque, each motor where it is      S ...
#   T 90,-12        target of each motor in degrees     S ...
#   P               nothing; asks for the state only    S ...
#   H  F  Q         hold; let go; let go and end        S seq,flags,bad,millivolts,angle,speed,load,angle,...
#
# Only E, T and H feed the dead man's switch. When it acts, the motors coast or hold, and targets are refused
# until the next E. Angles are degrees, speeds degrees a second, loads mN m.

from micropython import kbd_intr
from pybricks.hubs import ThisHub
from pybricks.iodevices import PUPDevice
from pybricks.parameters import Port
from pybricks.pupdevices import Motor
from pybricks.tools import StopWatch
from uselect import poll
from usys import stdin, stdout

HASH = "@HASH@"
IDLE_END_MS = 60000  # without torque and without a line for so long, the program ends
BYTES_A_TURN = 256  # the dead man's switch is looked at at least this often
LONGEST_LINE = 120
ENERGISED, TRIPPED, HOLDING = 1, 2, 4

TABLE = [0, 4129, 8258, 12387, 16516, 20645, 24774, 28903]
TABLE += [33032, 37161, 41290, 45419, 49548, 53677, 57806, 61935]


def crc16(data):
    crc = 0xFFFF
    for byte in data:
        crc = ((crc << 4) & 0xFFFF) ^ TABLE[(crc >> 12) ^ (byte >> 4)]
        crc = ((crc << 4) & 0xFFFF) ^ TABLE[(crc >> 12) ^ (byte & 15)]
    return crc


def send(text):
    data = bytes(text, "ascii")
    stdout.buffer.write(data + bytes("*%04x\r\n" % crc16(data), "ascii"))


def parse(line):
    star = line.find(b"*")
    if star < 3 or len(line) != star + 5:
        return None
    try:
        if int(str(line[star + 1 :], "ascii"), 16) != crc16(line[:star]):
            return None
    except ValueError:
        return None
    words = str(line[:star], "ascii").split(",")
    return words[0][0], words[0][1:], words[1:]


class Arm:
    def __init__(self):
        self.hub = ThisHub()
        self.watch = StopWatch()
        self.ports = ""
        self.motors = []
        self.found = []
        self.flags = 0
        self.bad = 0
        self.dead_man_ms = 500
        self.action = "F"
        self.fed_ms = self.heard_ms = self.watch.time()

    def configure(self, sequence, dead_man_ms, action, ports):
        self.dead_man_ms = int(dead_man_ms)
        self.action = action
        if ports != self.ports or len(self.motors) != len(ports):
            self.let_go()
            self.ports = ports
            self.motors = []
            self.found = [self.open(letter) for letter in ports]
        # else the motors go on counting their turns
        send("M" + sequence + "," + ",".join(self.found))

    def name(self, letter):
        try:
            return letter + ":" + str(PUPDevice(getattr(Port, letter)).info()["id"])
        except (OSError, AttributeError):
            return letter + ":0"

    def open(self, letter):
        name = self.name(letter)
        try:
            self.motors.append(Motor(getattr(Port, letter)))
        except (OSError, AttributeError):
            return name.replace(":", ":-") if name[-2:] != ":0" else name
        return name

    def energise(self):
        for motor in self.motors:
            motor.hold()
        self.flags = ENERGISED

    def follow(self, targets):
        if self.flags & ENERGISED and len(targets) == len(self.motors):
            self.flags = ENERGISED
            for motor, target in zip(self.motors, targets):
                motor.track_target(target)

    def hold(self):
        if self.flags & ENERGISED:
            for motor in self.motors:
                motor.hold()
            self.flags |= HOLDING

    def let_go(self):
        self.flags = 0
        for motor in self.motors:
            motor.stop()

    def look_after(self):
        now_ms = self.watch.time()
        if self.flags & ENERGISED and not self.flags & HOLDING and now_ms - self.fed_ms > self.dead_man_ms:
            if self.action == "H":
                self.hold()
                self.flags = TRIPPED | HOLDING
            else:
                self.let_go()
                self.flags = TRIPPED
        return self.flags & (ENERGISED | HOLDING) or now_ms - self.heard_ms < IDLE_END_MS

    def state(self, sequence):
        parts = ["S" + sequence, str(self.flags), str(self.bad & 255), str(self.hub.battery.voltage())]
        for motor in self.motors:
            parts += [str(motor.angle()), str(motor.speed()), str(motor.load())]
        send(",".join(parts))

    def obey(self, command):
        kind, sequence, arguments = command
        self.heard_ms = self.watch.time()
        if kind in "ETH":
            self.fed_ms = self.heard_ms
        if kind == "?":
            send("R" + sequence + "," + HASH + "," + str(self.hub.battery.voltage()))
            return False
        if kind == "C" and len(arguments) == 3:
            self.configure(sequence, *arguments)
            return False
        if kind == "E":
            self.energise()
        elif kind == "T":
            self.follow([int(target) for target in arguments])
        elif kind == "H":
            self.hold()
        elif kind in "FQ":
            self.let_go()
        self.state(sequence)
        return kind == "Q"


def main():
    kbd_intr(-1)  # a byte of 3 in a broken line must not end the program
    keyboard = poll()
    keyboard.register(stdin)
    arm = Arm()
    line = b""
    send("R00," + HASH + "," + str(arm.hub.battery.voltage()))
    while arm.look_after():
        newest = None
        count = 0
        while count < BYTES_A_TURN and keyboard.poll(0 if count else 20):
            byte = stdin.buffer.read(1)
            count += 1
            if byte != b"\n":
                line = line + byte if len(line) < LONGEST_LINE else b""
                continue
            command = parse(line)
            line = b""
            if command is None:
                arm.bad += 1
            elif command[0] == "T":
                newest = command  # targets that came meanwhile are out of date
            else:
                newest = None if command[0] in "HFQ" else newest
                if arm.obey(command):
                    return
        if newest:
            arm.obey(newest)


main()
