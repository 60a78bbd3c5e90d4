/* NewestRing of newest_ring.h, with the names used there. The producer pushes the serials 1 to PUSHES; their values
 * are the numbers of BUFFERS buffers that it fills before pushing. A buffer that was evicted is its own again at
 * once; one that the consumer is done with comes back through a release and an acquire, as in a SlotPool. Runs have
 * an end, since a consumer may fall behind by any number of serials; the runs here overrun the ring more than twice,
 * and leave values behind if N > 2. Memory: see weak_memory.pml. Cells are only exchanged; the relaxed looks at a
 * cell before that may find it empty still, unless the consumer has acquired a push that came after it was filled.
 *
 * Checked: each value leaves the ring once and into one hand, as popped, evicted or overtaken; no access to a
 * buffer is a race; popped serials grow; nothing that is still in the ring is skipped without being reported: a
 * serial is passed over only when it was evicted or overtaken; whoever fell behind gets a value at least as new as
 * any pushed before that pop; the last value pushed is popped; what is left behind after that is at most N - 1
 * values.
 * Left out: the counters. */
#ifndef N
#define N 2
#endif
#ifndef PUSHES
#define PUSHES 6
#endif
#ifndef BUFFERS
#define BUFFERS (N + 3) /* in the ring; one with the producer; two, for a moment, with a consumer that sweeps */
#endif
#define THREADS 2
#define SLOTS BUFFERS
#define MESSAGES (N + BUFFERS) /* one in each cell; one for each buffer's way back */
#include "weak_memory.pml"

#ifndef kSwap
#define kSwap ACQ_REL
#endif
#ifndef kSwapInPush /* the two exchanges, to be weakened one at a time */
#define kSwapInPush kSwap
#endif
#ifndef kSwapInTake
#define kSwapInTake kSwap
#endif
#ifndef SWEEP /* 0: a consumer that fell behind takes what it finds */
#define SWEEP 1
#endif

#define kProducer 0
#define kConsumer 1
#define kNone 255
#define message_of_return(buffer) (N + (buffer))

#define kEvicted 1
#define kOvertaken 2

#define kFree 0 /* where a buffer is */
#define kWithProducer 1
#define kInRing 2
#define kWithConsumer 3

byte serial_in[N], value_in[N]; /* the cells; serial 0: empty */
byte filled_at[N];              /* the first serial pushed into a cell since it was empty */
byte carried[N];                /* the newest serial that happened before whoever acquires the cell's message */
byte known;                     /* the newest serial that happened before the consumer's next step */
byte pushed, tail;
byte place[BUFFERS] = kFree;
byte content[BUFFERS];          /* the serial it was filled for */
byte gone[PUSHES + 1];          /* how a serial left without being popped */
bit finished;                   /* the producer is, and everything it did is visible */

active proctype producer() {
  byte serial, value, before;
  do
  :: serial < PUSHES ->
     serial++;
     /* a free buffer: there always is one */
     atomic {
       value = 0;
       do
       :: place[value] != kFree -> value++; assert(value < BUFFERS)
       :: else -> break
       od;
       place[value] = kWithProducer;
       loading(kProducer, message_of_return(value), ACQUIRE)
     };
     atomic { access(kProducer, value, access_of(kConsumer, value)); content[value] = 0 };
     atomic { access(kProducer, value, access_of(kConsumer, value)); content[value] = serial };
     /* push() */
     atomic {
       modifying(kProducer, serial % N, kSwapInPush);
#if kSwapInPush & RELEASE
       carried[serial % N] = serial;
#endif
       if
       :: serial_in[serial % N] == 0 -> before = kNone; filled_at[serial % N] = serial
       :: else ->
          before = value_in[serial % N];
          assert(place[before] == kInRing && !gone[serial_in[serial % N]]);
          gone[serial_in[serial % N]] = kEvicted;
          place[before] = kWithProducer
       fi;
       serial_in[serial % N] = serial;
       value_in[serial % N] = value;
       place[value] = kInRing;
       pushed = serial
     };
     if
     :: before != kNone ->
        /* it may be written again at once */
        atomic {
          access(kProducer, before, access_of(kConsumer, before));
          storing(kProducer, message_of_return(before), RELEASE);
          place[before] = kFree;
          before = 0
        }
     :: else
     fi
  :: else -> break
  od;
  finished = 1
}

/* The consumer is done with a buffer. */
inline give_back(buffer) {
  atomic {
    assert(place[buffer] == kWithConsumer);
    storing(kConsumer, message_of_return(buffer), RELEASE);
    place[buffer] = kFree
  }
}

#define seems_empty(cell) (serial_in[cell] == 0 || (filled_at[cell] > known && !finished))

/* take(): what was in the cell goes to taken and taken_value; 0 if the cell is, or seems, empty. In a sweep none
 * does: whoever found a later serial has acquired N pushes since the one it expected, one into each cell. */
inline take(cell, may_seem_empty) {
  atomic {
    assert(may_seem_empty || serial_in[cell] == 0 || !seems_empty(cell));
    if
    :: seems_empty(cell) -> taken = 0
    :: serial_in[cell] != 0 -> taken = kNone
    fi
  };
  if
  :: taken != 0 ->
     atomic {
       assert(serial_in[cell] != 0);
       modifying(kConsumer, cell, kSwapInTake);
       if
       :: (kSwapInTake & ACQUIRE) && carried[cell] > known -> known = carried[cell]
       :: else
       fi;
       taken = serial_in[cell];
       taken_value = value_in[cell];
       serial_in[cell] = 0;
       value_in[cell] = 0;
       filled_at[cell] = 0;
       assert(place[taken_value] == kInRing && !gone[taken]);
       place[taken_value] = kWithConsumer
     }
  :: else
  fi
}

inline drop(serial, value) {
  gone[serial] = kOvertaken;
  give_back(value)
}

active proctype consumer() {
  byte best, best_value, taken, taken_value, k, pushed_before;
  do
  :: tail == PUSHES -> break
  :: tail < PUSHES ->
     /* ready(), or parked until there is something */
     serial_in[(tail + 1) % N] != 0;
     /* pop() */
     pushed_before = pushed;
     take((tail + 1) % N, true);
     atomic { best = taken; best_value = taken_value };
     if
     :: best == 0 -> goto none
     :: best > 0 && best < tail + 1 -> drop(best, best_value); goto none
#if SWEEP
     :: best > tail + 1 ->
        k = 1;
        do
        :: k < N ->
           take((tail + 1 + k) % N, false);
           if
           :: taken > best -> drop(best, best_value); best = taken; best_value = taken_value
           :: taken != 0 && taken < best -> drop(taken, taken_value)
           :: else
           fi;
           k++
        :: else -> break
        od
#endif
     :: else
     fi;
     /* what is passed over was evicted or overtaken, or is left behind for later; and it began with an eviction */
     atomic {
       assert(best > tail && place[best_value] == kWithConsumer);
       assert(best == tail + 1 || gone[tail + 1] == kEvicted);
       assert(best == tail + 1 || best >= pushed_before);
       k = tail + 1;
       do
       :: k < best -> assert(gone[k] || serial_in[k % N] == k); k++
       :: else -> break
       od;
       tail = best
     };
     /* the buffer is looked at twice */
     atomic { access(kConsumer, best_value, access_of(kProducer, best_value)); assert(content[best_value] == best) };
     atomic { access(kConsumer, best_value, access_of(kProducer, best_value)); assert(content[best_value] == best) };
     give_back(best_value);
none:
     atomic { best = 0; best_value = 0; taken = 0; taken_value = 0; k = 0; pushed_before = 0 }
  od;
  /* every buffer is free or, N - 1 of them at most, left behind in the ring */
  finished;
  atomic {
    k = 0;
    do
    :: k < BUFFERS ->
       assert(place[k] == kFree || place[k] == kInRing);
       taken = taken + (place[k] == kInRing -> 1 : 0);
       k++
    :: else -> break
    od;
    assert(taken <= N - 1)
  }
}
