"""Two processes talk over ROS in our default environment; none of their sockets can be reached from outside."""

import os
import signal
import subprocess
import sys

import pytest

from boom_bringup import environment

PEER = """
import sys, rclpy
from rclpy.experimental import EventsExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

role, count, topics = sys.argv[1], int(sys.argv[2]), 5
rclpy.init()
node = rclpy.create_node("peer_" + role)
executor = EventsExecutor()
executor.add_node(node)
qos = QoSProfile(depth=2000, reliability=ReliabilityPolicy.RELIABLE)
received = [0] * topics
matched = False
if role == "talker":
    publishers = [node.create_publisher(JointState, f"/peer_{i}", qos) for i in range(topics)]
    done = node.create_subscription(JointState, "/peer_done", lambda message: received.__setitem__(0, 1), qos)
    while not all(p.get_subscription_count() for p in publishers):
        executor.spin_once(timeout_sec=0.05)
    message = JointState(name=["inner_boom_joint"], position=[0.0], velocity=[0.0])
    for k in range(count):
        for publisher in publishers:
            publisher.publish(message)
    print("sent", flush=True)
    while not received[0]:
        executor.spin_once(timeout_sec=0.5)
else:
    def listen(i):
        def take(message):
            received[i] += 1
        return node.create_subscription(JointState, f"/peer_{i}", take, qos, raw=True)
    subscriptions = [listen(i) for i in range(topics)]
    done = node.create_publisher(JointState, "/peer_done", qos)
    print("listening", flush=True)
    while sum(received) < topics * count:
        executor.spin_once(timeout_sec=0.5)
    while not done.get_subscription_count():
        executor.spin_once(timeout_sec=0.05)
    print("received", *received, flush=True)
    sys.stdin.readline()
    done.publish(JointState())
    done.wait_for_all_acked(rclpy.duration.Duration(seconds=5))
sys.stdin.readline()
rclpy.shutdown()
"""


def start(role, count):
    return subprocess.Popen(
        [sys.executable, "-c", PEER, role, str(count)],
        env=environment.for_processes(os.environ),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.fixture
def peers():
    """Starts peers and makes sure that none outlives the test, or hangs it."""
    processes = []

    def make(role, count):
        processes.append(start(role, count))
        return processes[-1]

    def give_up(number, frame):
        raise TimeoutError("the peers did not finish")

    previous = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(60)
    yield make
    signal.alarm(0)
    signal.signal(signal.SIGALRM, previous)
    for process in processes:
        process.kill()
        process.communicate()


@pytest.mark.process
def test_every_message_arrives_and_every_socket_is_on_the_loopback(peers):
    count = 1000
    listener = peers("listener", count)
    assert listener.stdout.readline() == "listening\n"
    talker = peers("talker", count)
    assert talker.stdout.readline() == "sent\n"
    assert listener.stdout.readline() == "received" + f" {count}" * 5 + "\n"

    sockets = [environment.bound_sockets(process.pid) for process in (listener, talker)]

    # Without sockets this test would prove nothing.
    assert all(sockets)
    assert [environment.off_loopback(found) for found in sockets] == [[], []]
    for process in (listener, talker):
        process.stdin.write("\n\n")
        process.stdin.flush()
    assert [process.wait() for process in (listener, talker)] == [0, 0]


@pytest.mark.process
def test_a_new_listener_hears_everything_after_another_one_was_killed(peers):
    count = 200
    killed = peers("listener", count)
    assert killed.stdout.readline() == "listening\n"
    killed.kill()
    killed.wait()

    listener = peers("listener", count)
    assert listener.stdout.readline() == "listening\n"
    peers("talker", count)

    assert listener.stdout.readline() == "received" + f" {count}" * 5 + "\n"


def test_a_socket_bound_to_every_address_is_found():
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as open_socket, socket.socket() as local_socket:
        open_socket.bind(("0.0.0.0", 0))
        local_socket.bind(("127.0.0.1", 0))
        port, local_port = open_socket.getsockname()[1], local_socket.getsockname()[1]
        local_socket.listen()

        found = environment.bound_sockets(os.getpid())

        assert ("udp", "0.0.0.0", port) in environment.off_loopback(found)
        assert ("tcp", "127.0.0.1", local_port) in found
        assert ("tcp", "127.0.0.1", local_port) not in environment.off_loopback(found)


def test_an_address_of_the_sixth_version_is_read_in_the_right_order():
    import socket

    with socket.socket(socket.AF_INET6, socket.SOCK_STREAM) as local_socket:
        try:
            local_socket.bind(("::1", 0))
        except OSError:
            pytest.skip("this machine has no IPv6 loopback")
        local_socket.listen()

        found = environment.bound_sockets(os.getpid())

        assert ("tcp6", "::1", local_socket.getsockname()[1]) in found
        assert environment.off_loopback([environment.BoundSocket("tcp6", "::ffff:127.0.0.1", 1)]) == []


def test_a_process_that_has_ended_has_no_sockets():
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()

    assert environment.bound_sockets(process.pid) == []
