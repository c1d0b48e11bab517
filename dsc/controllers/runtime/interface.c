/* Results of a call; several bits may be set. */
enum chart_status {
    CHART_OK = 0,
    CHART_FULL = 1,      /* the queue is full: the event is dropped, and counted in `dropped` */
    CHART_UNKNOWN = 2,   /* the event or a number cannot be posted, or the controller has ended */
    CHART_LOST = 4,      /* a queue of internal events is full: one is lost, and counted in `lost` */
    CHART_OVERFLOW = 8,  /* an integer left the range of 64 bits, or is too large to be a double */
    CHART_FAILED = 16,   /* no transition handles an error or an outcome: the controller has ended */
    CHART_RUNAWAY = 32,  /* the chart goes round: the controller has ended */
    CHART_BUSY = 64      /* there is more to do: call `chart_step` again */
};

/* The program around a controller; functions that are NULL are not called. Each may call `chart_post` and `chart_end`. */
struct chart_host {
    void *context;
    /* Start an activity; report its end with `chart_end(controller, run, event, data)`. */
    void (*start)(void *context, int activity, uint32_t run, const struct chart_arguments *arguments);
    /* Stop an activity that has not ended. */
    void (*stop)(void *context, int activity, uint32_t run);
    /* Execute a command. */
    void (*command)(void *context, int command, const struct chart_arguments *arguments);
    /* Receive an outcome of the plot. */
    void (*emit)(void *context, int event, const struct chart_attributes *data);
};

/* An event that waits to be handled; only this file reads it. */
struct chart_occurrence {
    struct chart_attributes data;
    uint32_t serial, run;
    int event, node, edge;
    bool exact, periodic;
};

/* A controller; read `data`, `ended`, `dropped` and `lost`, and leave the rest to the functions below. */
struct chart {
    struct chart_data data;
    bool ended;
    uint32_t dropped, lost;
    int status;
    struct chart_host host;
    struct chart_attributes event;
    bool active[CHART_NODES], waiting[CHART_NODES];
    uint32_t serial[CHART_NODES];
    bool known[CHART_MEMORIES + 1], memory[CHART_MEMORIES + 1][CHART_NODES];
    bool armed[CHART_TIMERS + 1], running[CHART_ACTIVITIES + 1];
    int64_t clock, due[CHART_TIMERS + 1];
    uint32_t order[CHART_TIMERS + 1], run[CHART_ACTIVITIES + 1], marks[CHART_EDGES + 1];
    struct chart_occurrence queue[CHART_QUEUE], internal[CHART_INTERNAL], kept[CHART_QUEUE];
    int queue_first, queue_count, internal_first, internal_count, kept_count;
    uint32_t turn, macrostep, runs, orders;
    int microsteps;
    bool finished, failed, cycled;
};

/* Enter the initial states; the status has CHART_FAILED if a parameter or an initial value does not fit. */
int chart_init(struct chart *c, const struct chart_host *host, const struct chart_parameters *parameters,
               int64_t now_ns);
/* Queue an event; `data` may be NULL. */
int chart_post(struct chart *c, int event, const struct chart_attributes *data);
/* Queue the outcome of the activity that was started with this `run`; `data` may be NULL. */
int chart_end(struct chart *c, uint32_t run, int event, const struct chart_attributes *data);
/* Handle the timers due until `now_ns`, in order, then the queued events. */
int chart_step(struct chart *c, int64_t now_ns);
/* Write the active states, outer states first, to `states`, and return their number. */
int chart_configuration(const struct chart *c, int states[CHART_NODES]);
