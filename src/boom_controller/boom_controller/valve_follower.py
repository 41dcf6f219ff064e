"""Draft valve follower."""
from __future__ import annotations
from math import exp, tanh
from boom_controller.pilot_stage import PilotValve

class ValveFollower:
    def __init__(self, p, e, pilot, settings):
        s = p.main_valve_spool
        self.A, self.d, self.f, self.sig = float(s.A_s), float(s.d_v), float(s.f_c), float(s.sigma_s)
        self.k = self.A*pilot.stiffness
        self._pilot = pilot
        self.h = p.pilot_valves.h
        self.plus, self.minus = PilotValve(p, e, 0.01), PilotValve(p, e, 0.01)
        self.tau_s, self.tau_p, self.imax, self.tau_rest = 0.01, 0.02, settings.largest_current, 0.05
        self.dead = 0.0
        self.reset()
    def reset(self):
        self.s = self.v = 0.0
        self.plus.settle(0.0); self.minus.settle(0.0)
    def pressure(self, nu):
        h0,h1,h2=self.h
        return 1e5*((h0*nu+h1)*nu+h2)
    def step(self, want):
        dt=0.01
        inside = abs(want) <= self.dead and abs(self.s) <= self.dead
        v = (want-self.s)*(1-exp(-dt/(self.tau_rest if inside else self.tau_s)))/dt
        F = self.k*(self.s+0.5*v*dt) + self.d*v + self.f*tanh(v/self.sig)
        pp, pm = self._pilot.split(F/self.A)
        # before: pressure at the beginning of the interval
        n0 = self.pressure(self.plus.output_held()) - self.pressure(self.minus.output_held())
        i1, i2 = self.drive(self.plus, pp), self.drive(self.minus, pm)
        n1 = self.pressure(self.plus.output_held()) - self.pressure(self.minus.output_held())
        for k in range(4):
            dp = n0 + (n1-n0)*(k+0.5)/4; h=dt/4
            v = self.v
            Fd = dp*self.A - self.k*self.s
            for _ in range(3):
                th = tanh(v/self.sig)
                g = (self.d+self.k*h)*v + self.f*th - Fd
                v -= g/(self.d+self.k*h+self.f/self.sig*max(1-th*th, 0.02))
            self.v = v; self.s += h*v
        return i1, i2, pp, pm
    def drive(self, valve, pressure):
        want = self._pilot.current(pressure); now = valve.output_held()
        i = min(max(valve.current_for(now+(1-exp(-0.01/self.tau_p))*(want-now)),0.0),self.imax)
        valve.advance(i)
        return i
