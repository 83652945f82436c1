// The rope as a student writes it for the course assignment: objects on the heap, held by
// pointers, a force for each spring, a move for each mass. What ropeode is timed against.
//
// rope_loop METHOD NODES STEPS DT REPEATS
//
// Prints the nanoseconds per step of each repeat, a checksum, and where the last mass ends:
// "ns 123.4 125.1 123.9 sum -3199.5 end -400 199.2".

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

struct Vector2 {
    double x = 0.0, y = 0.0;

    Vector2() = default;
    Vector2(double x, double y) : x(x), y(y) {}

    Vector2 operator+(const Vector2& other) const { return {x + other.x, y + other.y}; }
    Vector2 operator-(const Vector2& other) const { return {x - other.x, y - other.y}; }
    Vector2 operator*(double factor) const { return {x * factor, y * factor}; }
    Vector2 operator/(double factor) const { return {x / factor, y / factor}; }
    Vector2& operator+=(const Vector2& other) { return *this = *this + other; }
    Vector2& operator-=(const Vector2& other) { return *this = *this - other; }
    double norm() const { return std::sqrt(x * x + y * y); }
};

Vector2 operator*(double factor, const Vector2& vector) { return vector * factor; }

struct Mass {
    Mass(Vector2 position, double mass, bool pinned)
        : position(position), last_position(position), mass(mass), pinned(pinned) {}

    Vector2 position, last_position, velocity, forces;
    double mass;
    bool pinned;
};

struct Spring {
    Spring(Mass* a, Mass* b, double k)
        : m1(a), m2(b), k(k), rest_length((a->position - b->position).norm()) {}

    Mass *m1, *m2;
    double k, rest_length;
};

class Rope {
public:
    Rope(Vector2 start, Vector2 end, int num_nodes, double node_mass, double k, double damping)
        : damping(damping) {
        for (int i = 0; i < num_nodes; i++) {
            Vector2 position = start + (end - start) * (double(i) / (num_nodes - 1));
            masses.push_back(new Mass(position, node_mass, i == 0));
            if (i > 0) springs.push_back(new Spring(masses[i - 1], masses[i], k));
        }
    }

    ~Rope() {
        for (Spring* spring : springs) delete spring;
        for (Mass* mass : masses) delete mass;
    }

    void explicit_euler(double dt, Vector2 gravity) {
        pull_springs();
        for (Mass* m : masses) {
            if (!m->pinned) {
                m->forces += gravity * m->mass - damping * m->velocity;
                m->position += m->velocity * dt;
                m->velocity += m->forces / m->mass * dt;
            }
            m->forces = Vector2();
        }
    }

    void semi_implicit_euler(double dt, Vector2 gravity) {
        pull_springs();
        for (Mass* m : masses) {
            if (!m->pinned) {
                m->forces += gravity * m->mass - damping * m->velocity;
                m->velocity += m->forces / m->mass * dt;
                m->position += m->velocity * dt;
            }
            m->forces = Vector2();
        }
    }

    // The damping factor acts once per step, whatever dt is.
    void verlet(double dt, Vector2 gravity) {
        pull_springs();
        for (Mass* m : masses) {
            if (!m->pinned) {
                m->forces += gravity * m->mass;
                Vector2 before = m->position;
                m->position += (1 - damping) * (m->position - m->last_position) +
                               m->forces / m->mass * dt * dt;
                m->last_position = before;
            }
            m->forces = Vector2();
        }
    }

    std::vector<Mass*> masses;
    std::vector<Spring*> springs;
    double damping;

private:
    void pull_springs() {
        for (Spring* s : springs) {
            Vector2 along = s->m2->position - s->m1->position;
            double length = along.norm();
            Vector2 pull = s->k * (length - s->rest_length) * (along / length);
            s->m1->forces += pull;
            s->m2->forces -= pull;
        }
    }
};

int main(int argc, char** argv) {
    if (argc != 6) {
        std::fprintf(stderr, "usage: rope_loop METHOD NODES STEPS DT REPEATS\n");
        return 2;
    }
    const std::string method = argv[1];
    const int num_nodes = std::atoi(argv[2]), repeats = std::atoi(argv[5]);
    const long steps = std::atol(argv[3]);
    const double dt = std::atof(argv[4]);
    void (Rope::*step)(double, Vector2) = method == "explicit-euler"        ? &Rope::explicit_euler
                                          : method == "semi-implicit-euler" ? &Rope::semi_implicit_euler
                                          : method == "verlet"              ? &Rope::verlet
                                                                            : nullptr;
    if (!step) {
        std::fprintf(stderr, "rope_loop: no method %s\n", argv[1]);
        return 2;
    }

    double sum = 0.0;
    Vector2 end;
    std::printf("ns");
    for (int repeat = 0; repeat < repeats; repeat++) {
        Rope rope(Vector2(0, 200), Vector2(-400, 200), num_nodes, 1.0, 100.0, 0.01);
        const auto started = std::chrono::steady_clock::now();
        for (long i = 0; i < steps; i++) (rope.*step)(dt, Vector2(0, -1));
        const auto stopped = std::chrono::steady_clock::now();
        std::printf(" %.6g", std::chrono::duration<double, std::nano>(stopped - started).count() / steps);
        for (Mass* m : rope.masses) sum += m->position.x + m->position.y;
        end = rope.masses.back()->position;
    }
    std::printf(" sum %.17g end %.17g %.17g\n", sum, end.x, end.y);
}
