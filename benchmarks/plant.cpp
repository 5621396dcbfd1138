// The bare drone (gravity, static thrust, rotor lag) with classical Runge-Kutta steps, written by hand: the reference
// of benchmarks/plant.py. Same equations, same order of the method, attitude renormalised after every step.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

constexpr int N = 17;  // position 3, attitude 4, velocity 3, angular velocity 3, rotor speed 4
struct Drone {
    double mass, inertia[3], x[4], y[4], sign[4], thrust, torque, gravity, lag, target[4];
};

static inline void rate(const Drone& p, const double* s, double* d) {
    const double *q = s + 3, *v = s + 7, *w = s + 10, *r = s + 13;
    double lift = 0, mx = 0, my = 0, mz = 0;
    for (int k = 0; k < 4; ++k) {
        const double square = r[k] * r[k], force = p.thrust * square;
        lift += force;
        mx += p.y[k] * force;
        my -= p.x[k] * force;
        mz += p.sign[k] * p.torque * square;
        d[13 + k] = p.lag * (p.target[k] - r[k]);
    }
    for (int k = 0; k < 3; ++k) d[k] = v[k];
    const double a = 0.5 * w[0], b = 0.5 * w[1], c = 0.5 * w[2];
    d[3] = -q[1] * a - q[2] * b - q[3] * c;
    d[4] = q[0] * a + q[2] * c - q[3] * b;
    d[5] = q[0] * b - q[1] * c + q[3] * a;
    d[6] = q[0] * c + q[1] * b - q[2] * a;
    const double f = lift / p.mass;
    d[7] = f * 2 * (q[1] * q[3] + q[0] * q[2]);
    d[8] = f * 2 * (q[2] * q[3] - q[0] * q[1]);
    d[9] = f * (1 - 2 * (q[1] * q[1] + q[2] * q[2])) - p.gravity;
    const double* I = p.inertia;
    d[10] = ((I[1] - I[2]) * w[1] * w[2] + mx) / I[0];
    d[11] = ((I[2] - I[0]) * w[2] * w[0] + my) / I[1];
    d[12] = ((I[0] - I[1]) * w[0] * w[1] + mz) / I[2];
}

static inline void step(const Drone& p, double* s, double h) {
    double k1[N], k2[N], k3[N], k4[N], y[N];
    rate(p, s, k1);
    for (int i = 0; i < N; ++i) y[i] = s[i] + 0.5 * h * k1[i];
    rate(p, y, k2);
    for (int i = 0; i < N; ++i) y[i] = s[i] + 0.5 * h * k2[i];
    rate(p, y, k3);
    for (int i = 0; i < N; ++i) y[i] = s[i] + h * k3[i];
    rate(p, y, k4);
    for (int i = 0; i < N; ++i) s[i] += h / 6 * (k1[i] + 2 * (k2[i] + k3[i]) + k4[i]);
    double n = 0;
    for (int i = 3; i < 7; ++i) n += s[i] * s[i];
    n = 1 / std::sqrt(n);
    for (int i = 3; i < 7; ++i) s[i] *= n;
}

int main(int argc, char** argv) {
    const int steps = std::atoi(argv[1]), repetitions = std::atoi(argv[2]);
    double in[27];
    for (double& value : in)
        if (std::scanf("%lf", &value) != 1) return 1;
    Drone p;
    const double* i = in;
    p.mass = *i++;
    for (double& v : p.inertia) v = *i++;
    for (double& v : p.x) v = *i++;
    for (double& v : p.y) v = *i++;
    for (double& v : p.sign) v = *i++;
    p.thrust = *i++, p.torque = *i++, p.gravity = *i++, p.lag = *i++;
    for (double& v : p.target) v = *i++;
    const double h = *i++, z = *i++, speed = *i++;
    double best = 1e9, s[N];
    for (int r = 0; r < repetitions; ++r) {
        for (double& v : s) v = 0;
        s[2] = z, s[3] = 1;
        for (int k = 13; k < N; ++k) s[k] = speed;
        const auto start = std::chrono::steady_clock::now();
        for (int k = 0; k < steps; ++k) step(p, s, h);
        const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
        if (time.count() < best) best = time.count();
    }
    std::printf("%.4f %.17g %.17g %.17g\n", best / steps * 1e9, s[0], s[1], s[2]);
}
