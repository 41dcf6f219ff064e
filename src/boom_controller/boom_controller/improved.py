"""Draft."""
from __future__ import annotations
from math import exp, sqrt
from boom_controller.control_model import ControlModel, Point, Quantities
from boom_controller.controller import Measurement, Output, Reference
from boom_controller.errors import ControlError
from boom_controller.pilot_stage import StaticPilot, require_pilot_stage
from boom_controller.settings import Settings
from boom_controller.valve_follower import ValveFollower as ValveInverse
from boom_controller.valve_map import ValveMap

class Improved:
    mode = "improved"
    T = 0.03; p = 4.0; zeta = 0.8; obs = 15.0; kdmax = 10.0; soft = 0.0; massmax=3000.0
    spool_response=0.01; pilot_response=0.02; lmass=2.0; kv_on=1.0; wd=0.0; cgain=0.0; hp=2.0; rho=3e5; tau_rest=0.05
    def __init__(self, machine, pose, settings):
        require_pilot_stage(machine, "improved")
        self._model = ControlModel(machine, pose)
        p, e = self._model.p, self._model.e
        self._map = ValveMap(p, e)
        self.Aa, self.Ab = float(p.cylinder.A_a), float(p.cylinder.A_b)
        self._stroke = float(p.main_valve_spool.s_max)
        self._settings = settings
        self._pilot = StaticPilot(p, e, settings.neutral_pressure)
        self._inverse = ValveInverse(p, e, self._pilot, settings)
    def reset(self, m):
        q = self._at(Reference(m.angle), m, 0.0)
        self.w = 0.0
        self.m = 0.0
        self.d = q.jacobian*q.force - q.gravity
        self._inverse.reset()
        self._inverse.tau_s=self.spool_response; self._inverse.tau_p=self.pilot_response; self._inverse.imax=self._settings.largest_current; self._inverse.tau_rest=self.tau_rest
        self._inverse.dead=self._map.dead_extend*1.02
        self.ca=self.cb=1.0; self.xa=self.ya=self.xb=self.yb=0.0; self.ph=m.hose_pressure; self.pb=m.rod_pressure; self.dv=0.0; self.Klast=0.0; self.flast=q.force
        self.I=0.0
    def _at(self, r, m, load):
        return self._model.at(Point(m.angle, m.rate, m.hose_pressure, m.rod_pressure, r.angle, r.rate, r.acceleration, r.jerk, load))
    def step(self, r, m):
        dt = 0.01
        q = self._at(r, m, self.m)
        # observer of speed and load
        acc = (q.jacobian*q.force - q.friction - q.gravity)/q.inertia
        c = -(q.tip_gravity + q.tip_inertia*acc)/q.inertia
        err = m.rate - self.w
        self.w += dt*(acc + 2*self.obs*err)
        cc = c/(c*c+1e-8)   # regularised
        self.m += dt*self.obs**2*err*cc
        self.m = min(max(self.m, -500.0), self.massmax)
        # chamber stiffness
        v0 = q.jacobian*m.rate
        A1, A2 = self._map.areas(self._inverse.s)
        if self._inverse.s < 0: qa_, qb_ = q.extend_supply*A1, q.extend_tank*A2
        else: qa_, qb_ = q.retract_tank*A2, q.retract_supply*A1
        dpa, dpb = m.hose_pressure-self.ph, m.rod_pressure-self.pb
        self.ph, self.pb = m.hose_pressure, m.rod_pressure
        a = exp(-self.hp*dt)
        g = self.cgain*dt
        fa, fb = q.stiffness_head*(qa_-self.Aa*v0), q.stiffness_rod*(qb_+self.Ab*v0)
        self.xa=a*self.xa+dt*fa; self.ya=a*self.ya+dpa
        self.xb=a*self.xb+dt*fb; self.yb=a*self.yb+dpb
        if self.cgain:
            self.ca += g*self.ya*(self.xa-self.ca*self.ya)/(self.rho**2+self.ya**2)
            if m.rod_pressure>3e5: self.cb += g*self.yb*(self.xb-self.cb*self.yb)/(self.rho**2+self.yb**2)
            self.ca=min(max(self.ca,0.7),6.0); self.cb=min(max(self.cb,0.7),6.0)
        T = self.T
        ahead = Reference(r.angle+T*(r.rate+T/2*(r.acceleration+T/3*r.jerk)), r.rate+T*(r.acceleration+T/2*r.jerk), r.acceleration+T*r.jerk, r.jerk)
        qa = self._at(ahead, m, self.m)
        ka, kb = self.Aa*q.stiffness_head/self.ca, self.Ab*q.stiffness_rod/self.cb
        K = ka*self.Aa + kb*self.Ab
        mass = q.inertia/q.jacobian**2
        p = self.p
        kv = self.kv_on*max(3*p*p*mass/K-1, 0.0)
        kd = min(2*self.zeta*sqrt(K/mass*(1+kv)), self.kdmax)/K
        kp = (1+kv)*p/3
        e = q.position - q.reference_position
        ev = q.jacobian*m.rate - q.reference_jacobian*r.rate
        ff = q.feedforward_force
        Qe = (ka*qa_-kb*qb_)/K
        self.dv += self.wd*(dt*(v0-Qe-self.dv)+(q.force-self.flast)/K); self.flast=q.force
        self.dv=min(max(self.dv,-.05),.05)
        self.I = self.dv
        v = qa.reference_jacobian*ahead.rate - kp*e - kv*ev - kd*(q.force-ff) - self.I
        sigma = K*v + qa.feedforward_force_rate
        L = 1.0*self._stroke
        if sigma > 0:
            size = -min(self._map.extending(sigma, ka*q.extend_supply, -kb*q.extend_tank), L)
        else:
            size = min(self._map.retracting(sigma, ka*q.retract_tank, -kb*q.retract_supply), L)
        if self.soft and abs(sigma) < K*self.soft: size *= abs(sigma)/(K*self.soft)
        i1, i2, plus, minus = self._inverse.step(size)
        return Output(i1, i2, angle_error=r.angle-m.angle, piston_position_error=-e, force_error=ff-q.force, feedforward_force=ff, feedback_force=0.0, force_set_point=ff, force=q.force, spool_position=size, pilot_pressure_retract=plus, pilot_pressure_extend=minus, estimated_load=self.m)
