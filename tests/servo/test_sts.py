"""Feetech's servos on the bus: the frames of protocol 1.0, a table and habits of their own."""

from __future__ import annotations

from screwkin.servo.survey import AnsweringServo, each_once


def test_a_servo_that_answers_in_two_protocols_of_the_same_frames_is_listed_once():
    ax, mx = AnsweringServo(1, 12, 1.0, 1_000_000), AnsweringServo(2, 30, 2.0, 57_600)
    misread = AnsweringServo(1, 257, "FT-SCS", 1_000_000)  # its id and baud for a model number
    strange = AnsweringServo(3, 999, 1.0, 1_000_000)
    assert each_once([misread, ax, mx, strange]) == [ax, mx, strange]
    assert each_once([ax, misread]) == [ax]
    assert ax.name == "AX-12A"
    assert misread.name == "model 257"
